"""Spines and necks of different numbers of joints: the bend of one spread smoothly along the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import Anatomy
from distretarget.skeleton import Skeleton

Body = tuple[Skeleton, Anatomy]
Chain = tuple[int, ...]


def spread(source: Body, target: Body, kept: set[int], turns: NDArray[np.intp], shares: NDArray[np.float64]) -> None:
    """Write to `turns` and `shares`, as in `Matching`, what the joints of the target's spine and neck follow, where the
    source's have other numbers of joints; joints in `kept` stay as they are.

    The turn along a chain is taken as known in the middle of each source bone and straight between: each target joint
    follows the two source joints beside the middle of its own bone, along the chain's length.
    """
    for (theirs, top), (ours, our_top) in zip(_chains(source[1]), _chains(target[1]), strict=True):
        if not theirs or not ours or len(theirs) == len(ours):
            continue
        known, wanted = _middles(source[0], theirs, top), _middles(target[0], ours, our_top)
        places = np.interp(wanted, known, np.arange(len(known)))
        for joint, place in zip(ours, places, strict=True):
            if joint not in kept:
                lower = min(int(place), len(theirs) - 1)
                turns[joint] = theirs[lower], theirs[min(lower + 1, len(theirs) - 1)]
                shares[joint] = place - lower


def _chains(anatomy: Anatomy) -> tuple[tuple[Chain, int], tuple[Chain, int]]:
    """Spine and neck, each with the joint above it; -1 where there is none."""
    head = anatomy.roles.get("head", -1)
    return (anatomy.spine, next(iter(anatomy.neck), head)), (anatomy.neck, head)


def _middles(skeleton: Skeleton, chain: Chain, top: int) -> NDArray[np.float64]:
    """(joints,), where the middles of a chain's bones are, from 0 at its lowest joint to 1 at the joint above it.

    A chain without length counts evenly.
    """
    ends = [*chain, top if top >= 0 else chain[-1]]
    along = skeleton.path_lengths[chain[0], ends]
    if not along[-1] > 0:
        along = np.arange(len(ends), dtype=np.float64)
    return np.asarray((along[1:] + along[:-1]) / (2.0 * along[-1]))
