"""Check every answer to an attack, and the folder that it leaves."""

from __future__ import annotations

import argparse
import hashlib
import os
import stat
from pathlib import Path
from typing import NamedTuple

from attack_calls import Call
from attack_child import Answer, answer

REPLACED = (stat.S_IFREG, stat.S_IFLNK)  # with --overwrite; no device, pipe or folder is
OVER, MARK = ", overwritten", ".made-of"
Outcome = tuple[Answer, str]


class Attack(NamedTuple):
    """What is attacked: a call, one of its arguments or none, and how."""

    kind: str
    call: Call
    action: argparse.Action | None
    how: str

    def __str__(self) -> str:
        return f"{self.kind}: {' '.join(self.call.argv())} {self.action and label(self.action)} [{self.how}]"


def snapshot(folder: Path, hashed: bool = False) -> dict[str, tuple]:
    """Everything below a folder by name: its kind, and its link target, device number or content.  For a file
    that is its inode and time, which tell whether it was written, or with ``hashed`` its hash."""
    found = {}
    for path in folder.rglob("*"):
        facts = path.lstat()
        kind = stat.S_IFMT(facts.st_mode)
        if kind == stat.S_IFREG:
            what = facts.st_ino, facts.st_mtime_ns, facts.st_size
            what = hashlib.sha256(path.read_bytes()).hexdigest() if hashed else what
        else:
            what = os.readlink(path) if kind == stat.S_IFLNK else facts.st_rdev
        found[str(path.relative_to(folder))] = (kind, what)
    return found


def attempt(
    argv: list[str], folder: Path, *, own: tuple[str, ...] = ("",), names=(), given=(), **how
) -> Outcome:
    """Run a command, and say what is wrong with its answer or with what it did to the folder.

    Parameters
    ----------
    own
        How names begin that the command may write, and change where it succeeds and was told to.
    names
        Words of which a refusal has to repeat one.
    given
        Arguments that it has to look at if it succeeds.
    """
    before = snapshot(folder)
    a = answer(argv, folder, **how)
    after = snapshot(folder)
    may_change = a.code == 0 and {"--overwrite", "--resume"} & {*argv}
    replaced = {n for n, (kind, _) in before.items() if may_change and n.startswith(own) and kind in REPLACED}
    if a.code == 0:  # a mark beside an output is ours, and no older one may stand beside new lines
        replaced |= {n for n in before if n.startswith(own) and n.endswith(MARK)}
    lost = [n for n, what in before.items() if after.get(n) != what and n not in replaced]
    new = [n for n in after if n not in before]
    stray = [n for n in new if Path(n).name.startswith(".") or not n.startswith((*own, "derived"))]
    looked_at = {*a.used, "overwrite", "resume"}  # these, only where there is something
    ignored = {g.dest for g in given if a.code == 0} - looked_at
    if not (fault := a.fault):
        if lost:
            fault = f"changed or removed {', '.join(lost[:3])}"
        elif stray:
            fault = f"left {', '.join(stray[:3])}"
        elif a.code and argv[0] != "check" and names and not any(name and name in a.err for name in names):
            fault = f"does not name {names[0]}: {a.err.strip()[-200:]}"
        elif ignored:
            fault = f"ignores {', '.join(ignored)}"
    return a, fault


def label(action) -> str:
    return action.option_strings[-1] if action.option_strings else action.dest


def names_of(call: Call, action, *values: str) -> list[str]:
    """Words by which a refusal may name an argument, or an option of the call that it does not go with."""
    told = (" ".join(v.split()).encode(errors="backslashreplace").decode() for v in values)
    said = (word for v in told for word in (v, ascii(v)[1:-1], Path(v).name))
    others = (name for a, _ in call.given for name in a.option_strings)
    return [
        *action.option_strings,
        label(action),
        action.dest,
        str(action.metavar or action.dest),
        *said,
        *others,
    ]


def own_name(call: Call) -> tuple[str, ...]:
    return (Path(call.output or "out").name.partition(".")[0],)
