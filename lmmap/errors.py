"""The error raised for bad input."""


class InputError(Exception):
    """Bad input from outside: the message names the file, the problem and the remedy.

    Examples
    --------
    >>> lmmap.open_recording("no.h5")
    Traceback (most recent call last):
        ...
    lmmap.errors.InputError: no.h5: no such file; check the path
    """

    def _render_traceback_(self) -> list[str]:
        """What a notebook shows: the message alone, as on the command line."""
        return [f"InputError: {self}"]
