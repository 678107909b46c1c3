"""The one error of bad input."""


class InputError(Exception):
    """Bad input from outside: the message names the file, the problem and the remedy."""

    def _render_traceback_(self) -> list[str]:
        """What a notebook shows: the message alone, as on the command line."""
        return [f"InputError: {self}"]
