"""What ``lmmap completion`` prints."""

import shtab

from .arguments import parser


def completion(a) -> None:
    """The completion script of a shell."""
    print(shtab.complete(parser(shtab.FILE), a.shell))
