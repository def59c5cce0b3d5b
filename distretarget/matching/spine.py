"""Spines and necks with different numbers of joints: the bend of the source is spread smoothly along the target."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import Anatomy
from distretarget.body.body import Body
from distretarget.skeleton import Skeleton

Chain = tuple[int, ...]


def spine_blend(source: Body, target: Body) -> Iterator[tuple[int, tuple[int, int], float]]:
    """Yield the blend of each joint in a spine or neck that has more or fewer joints in the target than in the source.

    An item is the target joint, the two source joints whose rotations it blends, and the weight of the second [0 to 1].
    The rotation along the source's chain is known in the middle of each bone and interpolated between the middles; a
    target joint takes the rotation at the middle of its own bone. Places are shares of the chain's length.
    """
    if source.anatomy is None or target.anatomy is None:
        return
    for (source_chain, source_top), (target_chain, target_top) in zip(
        _chains(source.anatomy), _chains(target.anatomy), strict=True
    ):
        if not source_chain or not target_chain or len(source_chain) == len(target_chain):
            continue
        source_middles = _middles(source.skeleton, source_chain, source_top)
        target_middles = _middles(target.skeleton, target_chain, target_top)
        places = np.interp(target_middles, source_middles, np.arange(len(source_middles)))
        for joint, place in zip(target_chain, places, strict=True):
            first = min(int(place), len(source_chain) - 1)
            second = min(first + 1, len(source_chain) - 1)
            yield joint, (source_chain[first], source_chain[second]), place - first


def _chains(anatomy: Anatomy) -> tuple[tuple[Chain, int], tuple[Chain, int]]:
    """Spine and neck, each with the joint above its last one; -1 where there is none."""
    head = anatomy.roles.get("head", -1)
    return (anatomy.spine, next(iter(anatomy.neck), head)), (anatomy.neck, head)


def _middles(skeleton: Skeleton, chain: Chain, top: int) -> NDArray[np.float64]:
    """(joints,), the places of the middles of a chain's bones, from 0 at its lowest joint to 1 at the joint above it.

    In a chain without length all bones count as equally long.
    """
    ends = [*chain, top if top >= 0 else chain[-1]]
    along = skeleton.path_lengths[chain[0], ends]
    if not along[-1] > 0:
        along = np.arange(len(ends), dtype=np.float64)
    return np.asarray((along[1:] + along[:-1]) / (2.0 * along[-1]))
