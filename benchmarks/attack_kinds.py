"""Attacks by kind, each on every argument that the parser lists, and what has to be true of every answer.

An attack is a function of a folder with sound files and of random numbers.  It runs a command there and
returns the last answer and what is wrong, or nothing.
"""

from __future__ import annotations

import argparse
import collections
import hashlib
import os
import shutil
import stat
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from attack_calls import Call
from attack_child import Answer, answer
from attack_mutations import mutated

NOTES = "notes that nobody has a copy of\nand a second line"
WORDS = ("nan", "inf", "-1", "0", "1e300", "--", "pictures", "r.h5", "absent/absent", "x:y")
ABSURD = {"empty": "", "long": "n" * 300, "digits": "9" * 400, "bytes": "é\udcff", "two lines": "a\nb"}
ABSURD |= dict(zip(WORDS, WORDS, strict=True))
DIRECTED: dict[str, Path] = {}  # what `attack_directed` makes
SOUND: dict[str, list[str]] = collections.defaultdict(list)  # values of arguments in sound calls
TEXT = (".txt", ".csv", ".tum", ".json", ".yaml", "", ".made-of")
REPLACED = (stat.S_IFREG, stat.S_IFLNK)  # with --overwrite; no device, pipe or folder is
Outcome = tuple[Answer, str]


class Attack(NamedTuple):
    """What is attacked: a call, one of its arguments or none, and how."""

    kind: str
    call: Call
    action: argparse.Action | None
    how: str

    def run(self, folder: Path, rng) -> Outcome:
        """Attack in a folder with sound files, beside which ``sound`` is one that is not attacked."""
        return (LISTED | DRAWN)[self.kind][1](self, folder, rng)

    def __str__(self) -> str:
        return f"{self.kind}: {' '.join(self.call.argv())} {self.action and label(self.action)} [{self.how}]"


def snapshot(folder: Path, hashed: bool = False) -> dict[str, tuple]:
    """What is below a folder by its name: its kind, and what it links to, stands for or holds; of a file time
    and place tell whether it was written, a hash whether it is the same."""
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


def attempt(argv: list[str], folder: Path, *, own: str = "", names=(), given=(), **how) -> Outcome:
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
    lost = [n for n, what in before.items() if after.get(n) != what and n not in replaced]
    new = [n for n in after if n not in before]
    stray = [n for n in new if Path(n).name.startswith(".") or (own and not n.startswith((own, "derived")))]
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
    return [*action.option_strings, label(action), action.dest, *said, *others]


def own_name(call: Call) -> str:
    return Path(call.output or "out").name.partition(".")[0]


# --- nothing is wrong, or one promise of a format is broken ----------------------------------------


def run_sound(attack: Attack, folder: Path, rng) -> Outcome:
    """The command makes something of sound files, so that other attacks reach what lies behind its checks."""
    call = attack.call
    a, fault = attempt(call.argv(), folder, own=own_name(call), given=[action for action, _ in call.given])
    refused = a.code and call.name != "check"  # which needs the book
    return a, fault or (f"refused: {a.err}" if refused else "")


def run_directed(attack: Attack, folder: Path, rng) -> Outcome:
    argv = attack.call.argv((attack.action, [str(DIRECTED[attack.how])]))
    return attempt(argv, folder, own=own_name(attack.call))


# --- a file's name that is something else ----------------------------------------------------------


def is_path(action) -> bool:
    return action.type is Path or action.metavar in ("FOLDER", "WEIGHTS")


def node(path: Path, minor: int) -> None:
    """A device of our own, like /dev/null (3), /dev/zero (5) or /dev/full (7)."""
    os.mknod(path, 0o666 | stat.S_IFCHR, os.makedev(1, minor))


def user_folder(path: Path, mode: int = 0o755) -> None:
    path.mkdir()
    (path / "notes.txt").write_text(NOTES)
    path.chmod(mode)


def linked(path: Path, make=lambda target: target.write_text(NOTES)) -> None:
    target = path.with_name("it-user" + path.suffix)
    make(target)
    path.symlink_to(target.name)


THINGS = {
    "device": partial(node, minor=3), "full device": partial(node, minor=7),
    "endless device": partial(node, minor=5), "pipe": os.mkfifo, "link to a file": linked,
    "link to a folder": partial(linked, make=user_folder),
    "link to nothing": partial(linked, make=lambda target: None),
    "link to itself": lambda path: path.symlink_to(path.name),
    "user's file": lambda path: path.write_text(NOTES), "empty file": Path.touch,
    "user's folder": user_folder, "empty folder": Path.mkdir, "long name": None, "no folder": None,
    "below a file": None, "read-only folder": None, "own": None,
}  # fmt: skip
ELSEWHERE = {"long name": "n" * 300, "no folder": "absent/it", "below a file": "r.h5/it",
             "read-only folder": "locked/it"}  # fmt: skip
OVER = ", overwritten"


def things(call: Call) -> Iterator[tuple]:
    """Every argument that is a file, being something else; with and without ``--overwrite``."""
    for action in filter(is_path, call.actions):
        is_output = call.output is not None and call.value(action) == call.output
        for thing in (t for t in THINGS if t != "own" or is_output):
            yield from ((action, thing + over) for over in ("", OVER)[: 2 if call.action("overwrite") else 1])


def run_thing(attack: Attack, folder: Path, rng) -> Outcome:
    call, action, (thing, over, _) = attack.call, attack.action, attack.how.partition(OVER)
    is_output, suffix = call.value(action) == call.output, Path(call.value(action) or "it.json").suffix
    value = ELSEWHERE.get(thing, "it") + suffix
    own = value.partition("/")[0].partition(".")[0] if is_output else own_name(call)
    if thing == "read-only folder":
        folder.chmod(0o777)
        user_folder(folder / "locked", 0o555)
    elif thing == "own":
        attempt(call.argv((action, [value])), folder)
    elif THINGS[thing]:
        THINGS[thing](folder / value)
    more = [(call.action("overwrite"), [])] if over else []
    return attempt(call.argv((action, [value]), *more), folder, own=own, names=names_of(call, action, value),
                   nobody=thing == "read-only folder")  # fmt: skip


def run_swapped(attack: Attack, folder: Path, rng) -> Outcome:
    """A file's name that is another file's or folder's of any kind."""
    every = sorted(str(p.relative_to(folder)) for p in folder.rglob("*"))
    value, call, action = every[rng.integers(len(every))], attack.call, attack.action
    a, fault = attempt(call.argv((action, [value])), folder, names=names_of(call, action, value))
    return a, fault and f"{value}: {fault}"


# --- values ----------------------------------------------------------------------------------------


def run_value(attack: Attack, folder: Path, rng) -> Outcome:
    call, action, value = attack.call, attack.action, ABSURD[attack.how]
    own = "" if call.value(action) == call.output else own_name(call)
    argv = call.argv((action, [value]))
    return attempt(argv, folder, own=own, names=names_of(call, action, value), given=[action])


def values_of(action, rng) -> list[str]:
    """A value that an argument can have: one of its choices, or of `attack_calls.LINES`, or of its type."""
    usual = {int: "3", float: "0.4"}.get(action.type, "r.h5" if is_path(action) else "a")
    known = [*map(str, action.choices or SOUND.get(action.dest, [usual]))]
    return [] if action.nargs == 0 else [known[rng.integers(len(known))]]


def run_twice(attack: Attack, folder: Path, rng) -> Outcome:
    """An option given twice: refused by name, unless it is one of several that may be."""
    call, action = attack.call, attack.action
    value = call.value(action)
    pair = [[value] if value else values_of(action, rng), values_of(action, rng)]
    without = call._replace(given=[(a, v) for a, v in call.given if a is not action]).argv()
    words = [w for each in pair for w in (action.option_strings[-1], *each)]
    names = names_of(call, action, *pair[0], *pair[1])
    a, fault = attempt(without + words, folder, own=own_name(call), names=names, given=[action])
    last_wins = a.code == 0 and pair[0] != pair[1] and not isinstance(action, argparse._AppendAction)
    return a, fault or (f"the last {label(action)} wins, unsaid" if last_wins else "")


def run_together(attack: Attack, folder: Path, rng) -> Outcome:
    """Up to four further options at once, each with a value that it can have."""
    call = attack.call
    free = [a for a in call.actions if a.option_strings and a.dest != "output"]
    more = [(free[i], values_of(free[i], rng)) for i in rng.permutation(len(free))[: rng.integers(1, 5)]]
    given = [action for action, _ in (*call.given, *more)]
    a, fault = attempt(call.argv(*more), folder, own=own_name(call), given=given)
    return a, fault and f"{' '.join(call.argv(*more))}: {fault}"


# --- what is damaged, full or killed ---------------------------------------------------------------

_unbroken: dict[str, tuple[dict, Answer]] = {}
_kills: collections.Counter = collections.Counter()


def unbroken(call: Call, folder: Path) -> tuple[dict, Answer]:
    """What a call leaves in a folder of its own, and its answer; made once."""
    name = " ".join(call.argv())
    if name not in _unbroken:
        whole = shutil.copytree(folder.with_name("sound"), folder.with_name("whole"))
        a = answer(call.argv(), whole)
        _unbroken[name] = snapshot(whole, hashed=True), a
        shutil.rmtree(whole)
    return _unbroken[name]


def again(call: Call) -> list[list[str]]:
    """How a call may be given once more: as it is, and with the options that then are for it."""
    more = [a for a in (call.action("resume"), call.action("overwrite")) if a]
    return [call.argv(), *(call.argv((a, [])) for a in more)]


DAMAGE = {"empty": Path.touch, "folder": user_folder, "pipe": os.mkfifo,
          "endless device": THINGS["endless device"], "link to itself": THINGS["link to itself"],
          "removed": lambda path: None}  # fmt: skip
OUTPUT = " output"


def run_damaged(attack: Attack, folder: Path, rng) -> Outcome:
    """A file that the command reads, or that it left before, changed or replaced; then the command anew."""
    call, (how, output, _) = attack.call, attack.how.partition(OUTPUT)
    (left, whole), before = unbroken(call, folder), snapshot(folder)
    if output:
        answer(call.argv(), folder)
        files = [n for n in snapshot(folder) if n not in before]
    else:
        named = [folder / v for a, vs in call.given if is_path(a) for v in vs]
        files = [str(p.relative_to(folder)) for path in named for p in (path, *path.rglob("*"))] + whole.reads
    files = [n for n in sorted({*files}) if (folder / n).is_file()]
    if not files:
        return attempt(call.argv(), folder, own=own_name(call))
    path = folder / files[rng.integers(len(files))]
    content = path.read_bytes()
    path.unlink()
    if how in DAMAGE:
        DAMAGE[how](path)
    else:
        how, content = mutated(content or b"0", rng, path.suffix in TEXT)
        path.write_bytes(content)
    ways = again(call) if output else [call.argv()]
    argv = ways[rng.integers(len(ways))]
    a, fault = attempt(argv, folder, own=own_name(call))
    if not fault and output and how == "removed" and a.code == 0 and snapshot(folder, hashed=True) != left:
        fault = "goes on as if nothing were missing"
    return a, fault and f"{path.relative_to(folder)} {how}, {' '.join(argv)}: {fault}"


def run_killed(attack: Attack, folder: Path, rng) -> Outcome:
    """Killed before a write, or at some moment, once or twice; then run until it ends."""
    call = attack.call
    (left, whole), before, steps = unbroken(call, folder), snapshot(folder), []
    if not whole.writes or whole.code:
        return attempt(call.argv(), folder, own=own_name(call))
    for way in again(call)[: 1 + rng.integers(2)]:
        if rng.random() < 0.25:
            how = {"kill_after_s": float(rng.random() * whole.wall_s)}
        else:
            _kills[str(call.argv())] += 1
            how = {"kill_at": 1 + _kills[str(call.argv())] % whole.writes}
        answer(way, folder, **how)
        steps.append(str(how))
    for way in again(call):
        a = answer(way, folder)
        if a.fault or not a.code:
            break
    after = snapshot(folder, hashed=True)
    wrong = {n for n in {*after, *left} if after.get(n) != left.get(n)}
    if call.name == "live":  # whose poses are others each time
        wrong = {n for n in wrong if n not in before and Path(n).name.startswith(".")}
    fault = a.fault or (a.code and f"does not go on: {a.err}")
    fault = fault or (wrong and f"differs in {', '.join(sorted(wrong)[:4])}")
    return a, f"{', '.join(steps)}: {fault}" if fault else ""


def disturbances(call: Call) -> Iterator[tuple]:
    """A full disk, also over an older output, and a standard output that is full or closed."""
    overs = ("", OVER) if call.action("overwrite") and call.output else ("",)
    yield from ((None, f"{size} bytes of disk{over}") for size in (1, 300, 5000, 60_000) for over in overs)
    yield from ((None, f"stdout {how}") for how in ("full", "closed"))


def run_disturbed(attack: Attack, folder: Path, rng) -> Outcome:
    call, (what, over, _) = attack.call, attack.how.partition(OVER)
    node(folder / "full", minor=7)
    if over:
        (folder / call.output).write_text(NOTES)
    argv = call.argv((call.action("overwrite"), [])) if over else call.argv()
    how = {"stdout full": {"stdout": "full"}, "stdout closed": {"stdout": None}}.get(what)
    return attempt(argv, folder, own=own_name(call), **how or {"most_bytes": int(what.split()[0])})


# --- all of them -----------------------------------------------------------------------------------


def options(call: Call) -> list[argparse.Action]:
    return [a for a in call.actions if a.option_strings]


LISTED = {
    "sound": (lambda call: [(None, "sound files")], run_sound),
    "directed": (lambda call: ((a, n) for a in call.actions if a.dest == "recording" for n in DIRECTED),
                 run_directed),
    "file": (things, run_thing),
    "value": (lambda call: ((a, how) for a in call.actions if a.nargs != 0 for how in ABSURD), run_value),
    "twice": (lambda call: ((a, "twice") for a in options(call)), run_twice),
    "disturbed": (disturbances, run_disturbed),
}  # fmt: skip
DRAWN = {
    "another file": (lambda call: [(a, "another") for a in call.actions if is_path(a)], run_swapped),
    "together": (lambda call: [(None, "several options")] * bool(options(call)), run_together),
    "damaged": (lambda call: [(None, how + output) for how in (*["changed"] * 4, *DAMAGE)
                              for output in ("", OUTPUT)[: 2 if call.output else 1]], run_damaged),
    "killed": (lambda call: [(None, "killed")] * (call.output is not None), run_killed),
}  # fmt: skip


def attacks(calls: list[Call], rng, kinds=()) -> Iterator[Attack]:
    """Yield sound calls, and then without end one of each kind in turn: those that can be listed once each,
    of a command's calls one, and the others as they are drawn, of what takes long less often."""
    listed = {}
    for action, values in (given for call in calls for given in call.given):
        SOUND[action.dest] += values
    drawn = [kind for kind in DRAWN if not kinds or kind in kinds]
    for kind, (make, _) in ((k, v) for k, v in LISTED.items() if not kinds or k in kinds):
        every = [Attack(kind, call, *each) for call in calls for each in make(call)]
        every = [every[i] for i in rng.permutation(len(every))]
        one = {(a.call.name, a.action and a.action.dest, a.how, a.call.suffix): a for a in every}
        listed[kind] = every if kind == "sound" else [*one.values()]
    yield from listed.pop("sound", [])
    while drawn or any(listed.values()):
        yield from (each.pop() for each in listed.values() if each)
        for kind in drawn:
            known = [_unbroken.get(" ".join(call.argv())) for call in calls]
            weights = np.array([1 / (0.1 + (k[1].seconds if k else 0.3)) for k in known])
            call = calls[rng.choice(len(calls), p=weights / weights.sum())]
            if every := [*DRAWN[kind][0](call)]:
                yield Attack(kind, call, *every[rng.integers(len(every))])
