"""A hips joint that is elsewhere in the file, such as on the floor, is moved to the middle of the hip joints."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.body.body import Body
from distretarget.motion import Motion
from distretarget.numerics.quaternions import turned_by
from distretarget.numerics.vectors import Array
from distretarget.skeleton import Skeleton

FAR = 0.5  # the hips joint is moved if it is farther from the middle of the hip joints [leg lengths]


class JointShift(NamedTuple):
    """The displacement of a joint in its own axes; its rotation and all other joints stay as they are."""

    joint: int
    shift: Array  # (3,), in the joint's own axes [file units]

    @property
    def inverse(self) -> JointShift:
        """The opposite displacement."""
        return JointShift(self.joint, -self.shift)

    def skeleton(self, skeleton: Skeleton) -> Skeleton:
        """Return a skeleton with the joint displaced; the root's OFFSET stays, as it is no bone."""
        offsets = np.array(skeleton.offsets)
        offsets[list(skeleton.children[self.joint])] -= self.shift
        offsets[self.joint] += self.shift * (self.joint > 0)
        return skeleton.with_offsets(offsets)

    def motion(self, motion: Motion) -> Motion:
        """Return a motion with the joint displaced."""
        joint, translations = self.joint, motion.translations
        translations[:, list(motion.skeleton.children[joint])] -= self.shift
        translations[:, joint] += turned_by(np.ascontiguousarray(motion.rotations[:, joint]), self.shift)
        skeleton = self.skeleton(motion.skeleton)
        return Motion.of_translations(skeleton, translations, motion.rotations, motion.frame_time_text)


def shift_to_thighs(body: Body) -> JointShift | None:
    """Return the displacement of the hips joint to the middle of the hip joints; None if it is near already, as in most
    files, or if the thighs do not hang from it.
    """
    if body.anatomy is None or body.legs is None or "hips" not in body.anatomy.roles:
        return None
    hips, thighs, rest = body.anatomy.roles["hips"], [leg.hip for leg in body.legs], body.skeleton.rest_positions
    shift = rest[thighs].mean(axis=0) - rest[hips]
    hang = body.skeleton.common_ancestor(thighs) == hips
    return JointShift(hips, shift) if hang and np.linalg.norm(shift) > FAR * body.leg_length else None


def with_hips_at_thighs(body: Body) -> Body:
    """Return a body with its hips joint displaced by `shift_to_thighs`."""
    shift = shift_to_thighs(body)
    if shift is None:
        return body
    return Body.of(shift.skeleton(body.skeleton)) if body.motion is None else Body.of_motion(shift.motion(body.motion))
