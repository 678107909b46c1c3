"""Attacks by files: names of something else, and files that are damaged, half written or on a full disk."""

from __future__ import annotations

import collections
import os
import shutil
import stat
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from attack_calls import Call
from attack_checks import OVER, Attack, Outcome, attempt, names_of, own_name, snapshot
from attack_child import Answer, answer
from attack_mutations import mutated

NOTES = "notes that nobody has a copy of\nand a second line"
TEXT = (".txt", ".csv", ".tum", ".json", ".yaml", "", ".made-of")


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


def things(call: Call) -> Iterator[tuple]:
    """Replace each file argument by something else, with and without ``--overwrite``."""
    for action in filter(is_path, call.actions):
        is_output = call.output is not None and call.value(action) == call.output
        for thing in (t for t in THINGS if t != "own" or is_output):
            yield from ((action, thing + over) for over in ("", OVER)[: 2 if call.action("overwrite") else 1])


def run_thing(attack: Attack, folder: Path, rng) -> Outcome:
    call, action, (thing, over, _) = attack.call, attack.action, attack.how.partition(OVER)
    is_output, suffix = call.value(action) == call.output, Path(call.value(action) or "it.json").suffix
    value = ELSEWHERE.get(thing, "it") + suffix
    own = own_name(call) + (value.partition("/")[0].partition(".")[0],) * is_output  # it may have several
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


def swaps(call: Call) -> list[tuple]:
    """Replace each file argument by another file."""
    return [(action, "another") for action in call.actions if is_path(action)]


def run_swapped(attack: Attack, folder: Path, rng) -> Outcome:
    """A file's name that is another file's or folder's of any kind."""
    every = sorted(str(p.relative_to(folder)) for p in folder.rglob("*"))
    value, call, action = every[rng.integers(len(every))], attack.call, attack.action
    a, fault = attempt(call.argv((action, [value])), folder, names=names_of(call, action, value))
    return a, fault and f"{value}: {fault}"


# --- what is damaged, full or killed ---------------------------------------------------------------

UNBROKEN: dict[str, tuple[dict, Answer]] = {}
_kills: collections.Counter = collections.Counter()


def unbroken(call: Call, folder: Path) -> tuple[dict, Answer]:
    """What a call leaves in a folder of its own, and its answer; cached."""
    name = " ".join(call.argv())
    if name not in UNBROKEN:
        whole = shutil.copytree(folder.with_name("sound"), folder.with_name("whole"))
        a = answer(call.argv(), whole)
        UNBROKEN[name] = snapshot(whole, hashed=True), a
        shutil.rmtree(whole)
    return UNBROKEN[name]


def again(call: Call) -> list[list[str]]:
    """Ways to repeat a call: unchanged, and with ``--resume`` or ``--overwrite`` where it has them."""
    more = [a for a in (call.action("resume"), call.action("overwrite")) if a]
    return [call.argv(), *(call.argv((a, [])) for a in more)]


DAMAGE = {"empty": Path.touch, "folder": user_folder, "pipe": os.mkfifo,
          "endless device": THINGS["endless device"], "link to itself": THINGS["link to itself"],
          "removed": lambda path: None}  # fmt: skip
OUTPUT = " output"


def damages(call: Call) -> list[tuple]:
    """Change or replace a file that the command reads or left; change it most often."""
    outputs = ("", OUTPUT)[: 2 if call.output else 1]
    return [(None, how + output) for how in (*["changed"] * 4, *DAMAGE) for output in outputs]


def run_damaged(attack: Attack, folder: Path, rng) -> Outcome:
    """Change or replace a file that the command reads or has left, then run the command again."""
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
    """Kill the command before a write or at a random time, once or twice, then run it to its end."""
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
    ended = not wrong and ": exists" in a.err  # it was killed when all was written
    fault = a.fault or (a.code and not ended and f"does not go on: {a.err}")
    fault = fault or (wrong and f"differs in {', '.join(sorted(wrong)[:4])}")
    return a, f"{', '.join(steps)}: {fault}" if fault else ""


def disturbances(call: Call) -> Iterator[tuple]:
    """A full disk, also with an older output, and a full or closed standard output."""
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
