"""From the source's world to the target's: which axis points up, and what the root's OFFSET means."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.axes import axis_vector
from distretarget.body.body import OFF_FLOOR, Body
from distretarget.motion import Motion
from distretarget.numerics.rotations import least_rotation
from distretarget.skeleton import POSITION_CHANNELS

Array = NDArray[np.float64]
RootOffset = Literal["replaced", "added"]

ON_FLOOR = 0.1  # feet so near to height 0 are on the floor [leg lengths]


@dataclass(frozen=True)
class World:
    """How a source's world becomes the target's.

    Attributes:
        source_up, up: which of `AXES` points up in the source's file, and in the target's.
        root_offset: what the position channels of the source's root do to its OFFSET.
    """

    source_up: str
    up: str
    root_offset: RootOffset

    @property
    def up_vector(self) -> Array:
        """(3,), up in the target's world."""
        return axis_vector(self.up)

    def to_target_axes(self, source: Body) -> Body:
        """The source in the target's world."""
        motion = source.motion
        if motion is None:
            return source.with_up(self.up)
        if self.root_offset == "added":
            motion = with_root_offset(motion)
        return source.with_motion(turned(motion, self.source_up, self.up), self.up)


def find_world(
    source: Body,
    target: Body,
    source_up: str | None = None,
    target_up: str | None = None,
    root_offset: RootOffset | None = None,
) -> World:
    """The world of source and target, as far as it is not given.

    Up in the source is as its motion tells. Up in the target is what its file says; else as its motion tells, unless
    no body is recognised in it and one is in the source; else, if both rest poses stand along the same axis, as in the
    source; else the axis along which the target's rest pose stands. Where nothing tells, Y is up.
    """
    source_up = source_up or source.up
    tells = target.anatomy is not None or source.anatomy is None
    up = target_up or target.skeleton.up or (target.found_up if tells else None)
    up = up or (source_up if target.up_at_rest in (None, source.up_at_rest) else target.up_at_rest)
    return World(source_up, up, root_offset or find_root_offset(source, axis_vector(source_up)))


def turned(motion: Motion, up: str, onto: str) -> Motion:
    """The motion in a world where the axis `onto` points up instead of `up`, turned there by the least rotation: what
    faces Z with Y up faces -Y with Z up.
    """
    if up == onto:
        return motion
    turn = Rotation.from_quat(least_rotation(axis_vector(up)[None], axis_vector(onto)[None])[0])
    translations, rotations = np.array(motion.translations), np.array(motion.rotations)
    translations[:, 0] = turn.apply(translations[:, 0])
    rotations[:, 0] = (turn * Rotation.from_quat(rotations[:, 0])).as_quat()
    return replace(motion, translations=translations, rotations=rotations)


def find_root_offset(body: Body, up: Array) -> RootOffset:
    """Whether the root's position channels replace its OFFSET or are added to it, which nothing in a file says.

    They are added if that puts the feet on the floor, at height 0, and replacing leaves them clearly off it. `up` is
    (3,).
    """
    motion, length = body.motion, body.leg_length
    if motion is None or not length or not set(POSITION_CHANNELS) <= set(motion.skeleton.channels[0]):
        return "replaced"
    rise = float(motion.skeleton.offsets[0] @ up)
    lowest = body.lowest(up)
    return "added" if abs(lowest) > OFF_FLOOR * length and abs(lowest + rise) < ON_FLOOR * length else "replaced"


def with_root_offset(motion: Motion) -> Motion:
    """The motion with the root's OFFSET added to its positions."""
    translations = np.array(motion.translations)
    translations[:, 0] += motion.skeleton.offsets[0]
    return replace(motion, translations=translations)
