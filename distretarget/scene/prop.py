"""Props that performers touch, hold or sit on: a prop, a chair, a pole, an instrument."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from distretarget.errors import SettingsError
from distretarget.motion import Motion
from distretarget.skeleton import LARGEST, POSITION_CHANNELS, ROTATION_CHANNELS, SMALLEST

PropScale = Literal["world"] | int | float


@dataclass(frozen=True)
class Grip:
    """A joint that holds a prop while it is near it.

    Attributes:
        performer: the number of the performer, from 0.
        joint: the key of the joint in the performer's source.
    """

    performer: int
    joint: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Prop:
    """A prop in the world of the performers; its joints are points that may be touched.

    Attributes:
        name: what it is called.
        motion: where it is in the source; one frame for a prop that stands still.
        scale: target units per source unit: "world", as the world along the floor; the number of a performer, as that
            one's heights (an int); or a factor (a float), 1.0 for a prop that keeps its size.
        held_by: the joints that hold it. The prop follows them while they are near it.

    Raises:
        SettingsError: the scale is none of these.
    """

    name: str
    motion: Motion
    scale: PropScale = "world"
    held_by: tuple[Grip, ...] = ()

    def __post_init__(self) -> None:
        if isinstance(self.scale, float) and not SMALLEST <= self.scale <= LARGEST:
            raise SettingsError(f"the scale of {self.name!r} is {self.scale:g}; expected a number above 0")
        if not isinstance(self.scale, int | float) and self.scale != "world":
            raise SettingsError(
                f"the scale of {self.name!r} is {self.scale!r}; expected 'world', the number of a performer or a factor"
            )


def prop_of(motion: Motion, joint: str) -> Motion:
    """Return the motion of a joint and all joints below it as a motion of their own, such as a sword in a hand.

    Raises:
        SkeletonError: there is no such joint.
    """
    skeleton = motion.skeleton
    root = skeleton.index(joint)
    joints = np.sort([*skeleton.subtree(root)])
    channels = [skeleton.channels[each] for each in joints]
    channels[0] = (*POSITION_CHANNELS, *(channels[0][-3:] if len(channels[0]) >= 3 else ROTATION_CHANNELS))
    parents = np.searchsorted(joints, skeleton.parents[joints])
    parents[0] = -1
    below = replace(
        skeleton,
        names=tuple(skeleton.names[each] for each in joints),
        parents=parents,
        offsets=skeleton.offsets[joints],
        channels=tuple(channels),
        end_sites=np.append(False, skeleton.end_sites[joints[1:]]),
    )
    translations, rotations = np.array(motion.translations[:, joints]), np.array(motion.rotations[:, joints])
    translations[:, 0], rotations[:, 0] = motion.positions[:, root], motion.world_rotations_of(root)
    return Motion.of_translations(below, translations, rotations, motion.frame_time_text)
