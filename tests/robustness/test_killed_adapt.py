"""`lmmap adapt` killed at any moment: the next call ends it, and nothing else is left."""

from test_folder import adapt, nothing_to_learn  # noqa: F401
from test_kills import killed


def test_the_next_call_ends_it_and_leaves_the_folder_alone(tmp_path):
    for last in range(1, 200):
        folder = tmp_path / str(last) / "networks"
        folder.parent.mkdir()
        if (code := killed(lambda folder=folder: adapt(folder), last)) != 1:
            break
        assert adapt(folder)["rgb"].taken, last
        assert [p.name for p in folder.parent.iterdir()] == ["networks"], last
    assert code == 0 and last > 5
