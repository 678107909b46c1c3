"""Attacks by kind, each on every argument that the parser lists.

An attack runs a command in a folder with sound files, by random numbers; it returns the last answer and what
is wrong with it, or nothing.
"""

from __future__ import annotations

import argparse
import collections
from collections.abc import Iterator
from pathlib import Path

import attack_files
import numpy as np
from attack_calls import Call
from attack_checks import Attack, Outcome, attempt, label, names_of, own_name

WORDS = ("nan", "inf", "-1", "0", "1e300", "--", "pictures", "r.h5", "absent/absent", "x:y")
ABSURD = {"empty": "", "long": "n" * 300, "digits": "9" * 400, "bytes": "é\udcff", "two lines": "a\nb"}
ABSURD |= dict(zip(WORDS, WORDS, strict=True))
DIRECTED: dict[str, Path] = {}  # what `attack_directed` makes
SOUND: dict[str, list[str]] = collections.defaultdict(list)  # values of arguments in sound calls


def run_sound(attack: Attack, folder: Path, rng) -> Outcome:
    """The command makes something of sound files, so that other attacks reach what lies behind its checks."""
    call = attack.call
    a, fault = attempt(call.argv(), folder, own=own_name(call), given=[action for action, _ in call.given])
    refused = a.code and call.name != "check"  # which needs the book
    return a, fault or (f"refused: {a.err}" if refused else "")


def run_directed(attack: Attack, folder: Path, rng) -> Outcome:
    argv = attack.call.argv((attack.action, [str(DIRECTED[attack.how])]))
    return attempt(argv, folder, own=own_name(attack.call))


def run_value(attack: Attack, folder: Path, rng) -> Outcome:
    call, action, value = attack.call, attack.action, ABSURD[attack.how]
    own = ("",) if call.value(action) == call.output else own_name(call)
    argv = call.argv((action, [value]))
    return attempt(argv, folder, own=own, names=names_of(call, action, value), given=[action])


def values_of(action, rng) -> list[str]:
    """A value that an argument can have: one of its choices, or of `attack_calls.LINES`, or of its type."""
    usual = {int: "3", float: "0.4"}.get(action.type, "r.h5" if attack_files.is_path(action) else "a")
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


def options(call: Call) -> list[argparse.Action]:
    return [a for a in call.actions if a.option_strings]


LISTED = {
    "sound": (lambda call: [(None, "sound files")], run_sound),
    "directed": (lambda call: ((a, n) for a in call.actions if a.dest == "recording" for n in DIRECTED),
                 run_directed),
    "file": (attack_files.things, attack_files.run_thing),
    "value": (lambda call: ((a, how) for a in call.actions if a.nargs != 0 for how in ABSURD), run_value),
    "twice": (lambda call: ((a, "twice") for a in options(call)), run_twice),
    "disturbed": (attack_files.disturbances, attack_files.run_disturbed),
}  # fmt: skip
DRAWN = {
    "another file": (attack_files.swaps, attack_files.run_swapped),
    "together": (lambda call: [(None, "several options")] * bool(options(call)), run_together),
    "damaged": (attack_files.damages, attack_files.run_damaged),
    "killed": (lambda call: [(None, "killed")] * (call.output is not None), attack_files.run_killed),
}  # fmt: skip


def run(attack: Attack, folder: Path, rng) -> Outcome:
    """Attack in a folder with sound files, beside which ``sound`` is one that is not attacked."""
    return (LISTED | DRAWN)[attack.kind][1](attack, folder, rng)


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
            known = [attack_files.UNBROKEN.get(" ".join(call.argv())) for call in calls]
            weights = np.array([1 / (0.1 + (k[1].seconds if k else 0.3)) for k in known])
            call = calls[rng.choice(len(calls), p=weights / weights.sum())]
            if every := [*DRAWN[kind][0](call)]:
                yield Attack(kind, call, *every[rng.integers(len(every))])
