"""Options of another mode of a laboratory's command are refused by name, not silently ignored."""

import pytest

from lmmap.shipped import DATA
from lmmap_lab.rig import authors_bags, standin

MINI = DATA / "mini" / "test-low.aedat4"
SIMULATE = ("simulate", "--sequence", "realistic-7", "--seconds", "0.2", "-o", "{}/o.h5")
AS_PUBLISHED = ("simulate", "--as-published", "{}/set")
BOARD, PORT = ("calibrate", MINI, "--board", "8x5"), ("calibrate", MINI, "--port")
LENS, RIG = ("calibrate", MINI, "--focal"), ("calibrate", MINI)
REPRODUCE = ("reproduce", "--data", "{}")
ESTIMATE = ("estimate", MINI, "--modality", "rgb")
OF_A_RIG = (("--hand-eye", "h"), ("--free",), ("--base", "b"), ("--effector", "e"), ("--on-arm",))
REFUSED = [
    *((AS_PUBLISHED, option) for option in (
        ("--sequence", "test-low"), ("-o", "o.h5"), ("--overwrite",), ("--camera", "c"), ("--jobs", "1"),
        ("--scheduler", "s"), ("--profile", "quick"))),
    *((SIMULATE, ("--camera", "{}/c.json", *option)) for option in (("--scheduler", "s"), ("--jobs", "2"))),
    *((mode, option) for mode in (PORT, LENS)
      for option in (*OF_A_RIG, ("--board", "8x5"), ("--square", "1"))),
    *((BOARD, option) for option in (*OF_A_RIG, ("--modality", "rgb"), ("--rate", "5"))),
    (RIG, ("--square", "0.03")), (REPRODUCE, ("--jobs", "1")), (("dataset",), ("--json",)),
    (("print", "--ruler", "99", "-o", "{}/p.json"), ("--paper", "a4")), (("check",), ("--beside", "x")),
]  # fmt: skip


@pytest.mark.parametrize(
    ("mode", "option"), REFUSED, ids=[f"{' '.join(map(str, m[:3]))} {o[-2:]}" for m, o in REFUSED]
)
def test_what_a_mode_does_not_use_is_refused_by_name(tmp_path, lmmap, mode, option):
    standin.Camera.davis346().save(tmp_path / "c.json")
    code, out, err = lmmap(*(str(a).format(tmp_path) for a in (*mode, *option)))
    named = {"-o": "--output"}.get(name := [o for o in option if o.startswith("-")][-1], name)
    assert (code, out) == (1, "") and err.count("\n") == 1 and f"leave {named} out" in err, err
    assert [path.name for path in tmp_path.iterdir()] == ["c.json"]


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        ((*REPRODUCE[:1], "--adapt"), "give --data FOLDER as well"),
        ((*REPRODUCE[:1], "--go-on"), "leave it out"),
        ((*ESTIMATE, "--adapt", "3", "-o", "{}/x.networks"), "x.networks: so the folder of its networks"),
        *(((*ESTIMATE, "--adapt", s, "-o", "{}/o.csv"), "--adapt ") for s in ("1e300", "0", "-1", "nan")),
        *((("adapt", MINI, "--seconds", s, "-o", "{}/n"), "--seconds ") for s in ("1e300", "0", "-1", "nan")),
    ],
    ids=range(11),
)
def test_what_cannot_be_is_refused_by_its_name(tmp_path, lmmap, argv, said):
    code, out, err = lmmap(*(str(a).format(tmp_path) for a in argv))
    assert (code, out) == (1, "") and err.count("\n") == 1 and said in err, err
    assert not list(tmp_path.iterdir())


def test_a_users_hand_eye_file_stays(tmp_path, lmmap):
    path = tmp_path / authors_bags.HAND_EYE
    path.write_text("mine")
    code, _, err = lmmap("simulate", "--as-published", tmp_path)
    assert code == 1 and "is not ours to replace" in err and path.read_text() == "mine"
    path.unlink()
    standin.write_hand_eye(path)
    before = path.read_bytes()
    standin.write_hand_eye(path)
    assert path.read_bytes() == before
