"""What ``lmmap completion`` prints."""

from argparse import Namespace

import shtab

from .arguments import parser


def completion(a: Namespace) -> None:
    """Print the completion script for a shell."""
    print(shtab.complete(parser(shtab.FILE), a.shell))
