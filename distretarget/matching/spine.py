"""Spines and necks of different numbers of joints: the bend of the source's blended smoothly along the target's."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import Anatomy
from distretarget.body.body import Body
from distretarget.skeleton import Skeleton

Chain = tuple[int, ...]


def spine_blend(source: Body, target: Body) -> Iterator[tuple[int, tuple[int, int], float]]:
    """What the joints of the target's spine and neck follow where the source's have other numbers of joints: each
    joint of the target, the two source joints that it turns between, and the share of the second, 0 to 1.

    The turn along a chain is taken as known in the middle of each source bone, and as changing evenly between. Each
    target joint follows the two source joints beside the middle of its own bone, along the chain's length.
    """
    if source.anatomy is None or target.anatomy is None:
        return
    for (source_chain, source_top), (target_chain, target_top) in zip(
        _chains(source.anatomy), _chains(target.anatomy), strict=True
    ):
        if not source_chain or not target_chain or len(source_chain) == len(target_chain):
            continue
        known = _middles(source.skeleton, source_chain, source_top)
        wanted = _middles(target.skeleton, target_chain, target_top)
        places = np.interp(wanted, known, np.arange(len(known)))
        for joint, place in zip(target_chain, places, strict=True):
            first = min(int(place), len(source_chain) - 1)
            second = min(first + 1, len(source_chain) - 1)
            yield joint, (source_chain[first], source_chain[second]), place - first


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
