"""Roots: the hips themselves, or a joint above them in the tree, on the floor, over the head or beside the hips."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from distretarget.skeleton import POSITION_CHANNELS, Skeleton
from zoo.conventions import Naming
from zoo.tree import places

Root = Literal["hips", "floor", "above", "offset child"]

OVERHEAD = 1.2  # height of a root over the head [body heights]
BESIDE = np.array([0.0, 0.03, 0.06])  # a root from its child, the hips [body heights]


def hips(skeleton: Skeleton, _naming: Naming) -> Skeleton:
    """The hips the root, as they are."""
    return skeleton


def floor(skeleton: Skeleton, naming: Naming) -> Skeleton:
    """A root on the floor, and hips with position channels of their own, as in Bandai Namco's files."""
    return _below(skeleton, naming.root, np.zeros(3), skeleton.channels[0])


def above(skeleton: Skeleton, naming: Naming) -> Skeleton:
    """A root over the head that alone has position channels, like the hand of a puppeteer."""
    overhead = OVERHEAD * float(places(skeleton)[:, 1].max())
    return _below(skeleton, naming.root, np.array([0.0, overhead, 0.0]), _rotations(skeleton))


def offset_child(skeleton: Skeleton, naming: Naming) -> Skeleton:
    """A root above and before the hips that alone has position channels, like a centre of mass."""
    place = skeleton.offsets[0] + BESIDE * float(places(skeleton)[:, 1].max())
    return _below(skeleton, naming.root, place, _rotations(skeleton))


def _rotations(skeleton: Skeleton) -> tuple[str, ...]:
    return tuple(channel for channel in skeleton.channels[0] if channel not in POSITION_CHANNELS)


def _below(skeleton: Skeleton, name: str, place: NDArray[np.float64], channels: tuple[str, ...]) -> Skeleton:
    """The body below a root at a place, (3,); the hips have these channels."""
    offsets = np.array(skeleton.offsets)
    offsets[0] -= place
    return Skeleton(
        names=(name, *skeleton.names),
        parents=np.concatenate([[-1], skeleton.parents + 1]),
        offsets=np.vstack([place, offsets]),
        channels=(skeleton.channels[0], channels, *skeleton.channels[1:]),
        end_sites=np.concatenate([[False], skeleton.end_sites]),
        units=skeleton.units,
        up=skeleton.up,
    )


ROOTS: Mapping[Root, Callable[[Skeleton, Naming], Skeleton]] = {
    "hips": hips,
    "floor": floor,
    "above": above,
    "offset child": offset_child,
}
