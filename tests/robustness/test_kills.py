"""Killed at any moment, a writer leaves the old file or the new one, and nothing that the next run keeps."""

import os
import warnings
from contextlib import suppress

import pytest
from test_files import WRITERS, names

LARGEST = 60  # of the moments of one writer


def killed(write, last: int) -> int:
    """Run a writer in a process of its own that ends at the ``last`` of its moments, which are before and
    after each name that it gives or removes; its exit code, 1 where it was killed."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # this process has threads, of which none is used
        child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    moments = iter(range(1, 10**6))

    def moment():
        if next(moments) == last:
            os._exit(1)

    def with_moments(function):
        def run(*arguments, **named):
            moment()
            function(*arguments, **named)
            moment()

        return run

    for name in ("replace", "unlink", "rmdir"):
        setattr(os, name, with_moments(getattr(os, name)))
    with suppress(BaseException):
        write()
        os._exit(0)
    os._exit(2)


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("old", [True, False])
def test_what_a_killed_run_left_is_removed_by_the_next(tmp_path, name, old):
    path = tmp_path / name
    mine = {f"{name}.made-of"}
    for last in range(1, LARGEST):
        path.unlink(missing_ok=True)
        if old:
            path.write_bytes(b"old")
        if (code := killed(lambda: WRITERS[name](path), last)) != 1:
            break
        assert not old or path.exists()
        WRITERS[name](path)
        assert names(tmp_path) - mine == {name}, last
    assert code == 0 and last > 2
