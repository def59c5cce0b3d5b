"""The root's path on a skeleton whose root lacks position channels: in those of the joints below it, or left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion
from distretarget.numerics.vectors import Flags, Numbers
from distretarget.skeleton import POSITION_CHANNELS, Skeleton


def path_carriers(skeleton: Skeleton, body: Numbers) -> list[int] | None:
    """Return the joints whose position channels hold the root's path where its own do not, the topmost of each branch;
    none if its own do; None if some of the joints of the `body` have no such joint above them.
    """
    if set(POSITION_CHANNELS) <= set(skeleton.channels[0]):
        return []
    moving = [set(POSITION_CHANNELS) <= set(channels) for channels in skeleton.channels]
    found = set()
    for joint in body.tolist():
        line = [each for each in skeleton.line(joint) if each and moving[each]]
        if not line:
            return None
        found.add(line[-1])
    return sorted(found)


def along_channels(motion: Motion, body: Numbers) -> Motion:
    """Return a motion whose root moves only along its position channels. Joints below it that can move keep their
    places, if they carry the whole `body`, (joints,); else the body stays where the root is.
    """
    skeleton, carriers = motion.skeleton, path_carriers(motion.skeleton, body)
    if carriers == []:
        return motion
    path = np.where(_held_axes(skeleton), motion.root_positions, skeleton.offsets[0])
    if carriers is None:
        return replace(motion, root_positions=path)
    translations = motion.translations
    translations[:, 0] = path
    for joint in carriers:
        parent = int(skeleton.parents[joint])
        fixed = replace(motion, root_positions=path)
        back = Rotation.from_quat(motion.world_rotations_of(parent)).inv()
        places, above = motion.positions_of(np.array([joint])), fixed.positions_of(np.array([parent]))
        translations[:, joint] = back.apply(places[:, 0] - above[:, 0])
    return Motion.of_translations(skeleton, translations, motion.rotations, motion.frame_time_text)


def _held_axes(skeleton: Skeleton) -> Flags:
    """(3,), whether the root has a position channel along each axis."""
    return np.array([channel in skeleton.channels[0] for channel in POSITION_CHANNELS])
