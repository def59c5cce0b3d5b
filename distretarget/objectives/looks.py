"""Directions that are asked for: head, hands and feet turned as the source's, or with their front to a direction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.body import Body
from distretarget.contact_entries import Look, Place
from distretarget.motion import Motion
from distretarget.numerics.vectors import cross, lengths, normalised
from distretarget.objectives.asking import Wishes

Array = NDArray[np.float64]


def with_looks(posed: Motion, wishes: Wishes, body: Body) -> Motion:
    """Return a motion of the target's body with parts turned as asked for, and all that they carry with them."""
    clip = wishes.clip
    for wish in wishes.wishes:
        if isinstance(wish.entry, Look):
            roles = body.anatomy.roles if body.anatomy else {}
            joint = roles.get(wish.entry.look, int(wish.joints[0][0]))  # the region of the head begins at the neck
            goal = Rotation.from_quat(clip.copy.world_rotations[:, joint])
            if wish.entry.like != "source":
                goal = _facing(goal, wish.entry.like, front_of(body, clip.copy, joint))
            posed = _turned(posed, joint, goal, wishes.firmness(wish))
    return posed


def front_of(body: Body, motion: Motion, joint: int) -> Array:
    """(frames, 3), where the front of a joint points, as in the reference pose the body's does."""
    pose = body.reference
    front = Rotation.from_quat(pose.rotations[joint]).inv().apply(pose.axes[:, 2])
    return np.asarray(Rotation.from_quat(motion.world_rotations_of(joint)).apply(front))


def _facing(turned: Rotation, direction: Place, now: Array) -> Rotation:
    """The rotations of a joint turned the shortest way so that its front, which points to `now`, has a direction."""
    goal = np.broadcast_to(normalised(np.array([direction], float)), now.shape)
    axis = cross(now, goal)
    angle = np.arctan2(lengths(axis), (now * goal).sum(axis=1))
    return Rotation.from_rotvec(normalised(axis) * angle[:, None]) * turned


def _turned(posed: Motion, joint: int, goal: Rotation, weight: Array) -> Motion:
    """The motion with a joint turned towards world rotations, by a weight from 0 to 1 in each frame."""
    on, parent = weight > 0.0, posed.skeleton.parents[joint]
    world = Rotation.from_quat(posed.world_rotations[on, joint])
    way = (goal[on] * world.inv()).as_rotvec()
    turned = Rotation.from_rotvec(weight[on, None] * way) * world
    above = Rotation.from_quat(posed.world_rotations[on, parent]) if joint else None
    rotations = np.array(posed.rotations)
    rotations[on, joint] = (above.inv() * turned if above else turned).as_quat()
    return replace(posed, rotations=rotations)
