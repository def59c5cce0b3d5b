"""The pelvis: bodies whose file has the joint of the hips elsewhere, as on the floor, get it where the thighs begin."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.body.body import Body
from distretarget.motion import Motion
from distretarget.numerics.quaternions import turned_by
from distretarget.numerics.vectors import Array
from distretarget.skeleton import Skeleton

FAR = 0.5  # the hips' joint is elsewhere if it is farther than this from between the hip joints [leg lengths]


class Way(NamedTuple):
    """How a joint is moved to another place: it turns as before, and all other joints stay where they are."""

    joint: int
    shift: Array  # (3,), in the joint's own axes [file units]

    @property
    def back(self) -> Way:
        """The way back."""
        return Way(self.joint, -self.shift)

    def skeleton(self, skeleton: Skeleton) -> Skeleton:
        """Return a skeleton with the joint there; the root's OFFSET stays, as it is no bone."""
        offsets = np.array(skeleton.offsets)
        offsets[list(skeleton.children[self.joint])] -= self.shift
        offsets[self.joint] += self.shift * (self.joint > 0)
        return skeleton.with_offsets(offsets)

    def motion(self, motion: Motion) -> Motion:
        """Return a motion with the joint there."""
        joint, translations = self.joint, motion.translations
        translations[:, list(motion.skeleton.children[joint])] -= self.shift
        translations[:, joint] += turned_by(np.ascontiguousarray(motion.rotations[:, joint]), self.shift)
        skeleton = self.skeleton(motion.skeleton)
        return Motion.of_translations(skeleton, translations, motion.rotations, motion.frame_time_text)


def way_to_thighs(body: Body) -> Way | None:
    """Return the way from the joint of the hips, from which the thighs hang, to the middle of the hip joints; None if
    it is near that already, as in most files.
    """
    if body.anatomy is None or body.legs is None or "hips" not in body.anatomy.roles:
        return None
    hips, thighs, rest = body.anatomy.roles["hips"], [leg.hip for leg in body.legs], body.skeleton.rest_positions
    shift = rest[thighs].mean(axis=0) - rest[hips]
    hang = body.skeleton.meet(thighs) == hips
    return Way(hips, shift) if hang and np.linalg.norm(shift) > FAR * body.leg_length else None


def at_thighs(body: Body) -> Body:
    """Return a body whose hips are where its thighs begin."""
    way = way_to_thighs(body)
    if way is None:
        return body
    return Body.of(way.skeleton(body.skeleton)) if body.motion is None else Body.of_motion(way.motion(body.motion))
