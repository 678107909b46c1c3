"""The chain of links from one end of an arm to the other, among those that a bag reports."""

from __future__ import annotations

import warnings
from collections import defaultdict, deque

import numpy as np

from lmmap.types import InputError

from . import ur5e
from .ur5e import LinkMotion


def complete_chain(path, links: dict, joints: dict, root: str, tip: str) -> tuple[dict, list]:
    """The links, with the nominal arm's where some are missing, and the chain from root to tip."""
    chain = find_chain(links, root, tip)
    for parent, child, _ in chain or ():
        if find_chain(links.keys() - {(parent, child)}, root, tip):
            raise InputError(f"{path}: /tf leads from {root} to {tip} with {parent} to {child} and without; "
                             "give a bag whose links form a tree")  # fmt: skip
    if chain is not None:
        return links, chain
    completed = nominal_links(joints) | links
    chain = find_chain(completed, root, tip)
    if chain is None:
        raise InputError(f"{path}: {_missing_link(links, joints, root, tip)}")
    added = [f"{p} to {c}" for p, c, _ in chain if (p, c) not in links and (p, c) not in ur5e.FIXED]
    if added:
        warnings.warn(f"{path}: /tf lacks {', '.join(added)}; taking /joint_states and the nominal UR5e",
                      stacklevel=3)  # fmt: skip
    return completed, chain


def nominal_links(joints) -> dict[tuple[str, str], LinkMotion]:
    """Links of the nominal arm: the fixed ones, and those whose joint is reported."""
    links = {pair: LinkMotion(np.zeros(1, np.int64), T[None]) for pair, T in ur5e.FIXED.items()}
    for index, name in enumerate(ur5e.JOINTS):
        if name in joints:
            t_us, angle = joints[name]
            ends = ur5e.LINKS[index], ur5e.LINKS[index + 1]
            links[ends] = LinkMotion(t_us, ur5e.joint_link(index, angle[:, 0]))
    return links


def find_chain(links, root: str, tip: str) -> list[tuple[str, str, bool]] | None:
    """The shortest chain from root to tip: ``(parent, child, whether backward)`` of each link."""
    neighbours = defaultdict(list)
    for parent, child in links:
        neighbours[parent].append((child, (parent, child, False)))
        neighbours[child].append((parent, (parent, child, True)))
    reached_by, waiting = {root: None}, deque([root])
    while waiting:
        frame = waiting.popleft()
        for other, step in neighbours[frame]:
            if other not in reached_by:
                reached_by[other] = (frame, step)
                waiting.append(other)
    if tip not in reached_by:
        return None
    chain, frame = [], tip
    while reached_by[frame]:
        frame, step = reached_by[frame]
        chain.append(step)
    return chain[::-1]


def _missing_link(links, joints, root: str, tip: str) -> str:
    """Why there is no chain, and the remedy."""
    everything = (
        nominal_links({name: (np.zeros(1, np.int64), np.zeros((1, 1))) for name in ur5e.JOINTS}) | links
    )
    whole = find_chain(everything, root, tip)
    if whole is None:
        frames = sorted({frame for pair in links for frame in pair})
        return (f"no frames {root} and {tip} in /tf; it has {', '.join(frames) or 'none'}; "
                "name the arm's two ends with --base and --effector")  # fmt: skip
    known = nominal_links(joints) | links
    missing = [f"{p} to {c}" for p, c, _ in whole if (p, c) not in known]
    return (f"/tf has no link {', '.join(missing)}, and /joint_states has not its joint; "
            "give a bag with the whole arm")  # fmt: skip
