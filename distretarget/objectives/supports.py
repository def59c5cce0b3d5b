"""Supports: joints that rest on the world, and the springs that hold them in place.

1/2 sum over supports   r^T A r,    r = x - place,    with A as in `ik.holds`
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from distretarget.ik.articulation import Articulation
from distretarget.ik.holds import write_holds
from distretarget.ik.springs import FloorSprings, Springs, no_floor, no_springs
from distretarget.numerics.vectors import Array, Numbers

STIFFNESS = 5000.0  # k, far above all other stiffnesses
RESTS = 0.99  # a joint of this weight or more rests
ROOT_BLEND = 0.2  # the root takes about twice this time from one height or shift to the next [s]
BLEND = 0.16  # the weight of a joint rises over twice this time before it rests, and falls over as much after it [s]


@dataclass(frozen=True, eq=False, kw_only=True)
class Supports:
    """Joints that rest on the world in some frames, and their places. Foot joints come first. Slicing selects frames.

    Attributes:
        joints: (supports,), joints of the target.
        regions: (supports,), the body region of each.
        feet: the number of foot joints: ankle and toe of one leg, then those of the other.
        weights: (frames, supports), 1 while the source's joint rests, blended to 0.
        places: (frames, supports, 3), where the target's joint rests [target file units].
        floor: the heights that other joints keep above [body units].
        scene_springs: springs to other performers and to props [body units].
        user_springs: springs of user constraints: contacts, distances and parts planted on the body [body units].
    """

    joints: Numbers
    regions: Numbers
    feet: int
    weights: Array
    places: Array
    floor: FloorSprings
    scene_springs: Springs
    user_springs: Springs

    @property
    def standing(self) -> Array:
        """(frames,), 1 while a foot rests, blended to 0."""
        return np.asarray(self.weights[:, : self.feet].max(axis=1, initial=0.0))

    @property
    def beside_feet(self) -> Array:
        """(frames,), 1 while something other than a foot rests, blended to 0."""
        return np.asarray(self.weights[:, self.feet :].max(axis=1, initial=0.0))

    def of_regions(self, count: int) -> Array:
        """(frames, regions), the largest weight of a support in each of the `count` body regions, 0 to 1."""
        largest = np.zeros((count + 1, len(self.weights)))  # the last row is for joints outside the body
        np.maximum.at(largest, self.regions, self.weights.T)
        return largest[:-1].T

    @property
    def touches(self) -> Iterator[tuple[int, Array]]:
        """The joints that touch other performers or props, each with the weight of its contact, (frames,), 0 to 1."""
        springs = self.scene_springs
        stiffness = np.trace(springs.A, axis1=-2, axis2=-1)
        return zip(springs.a.tolist(), (stiffness / (stiffness + 1.0)).T, strict=True)

    def with_joints(self, joints: Numbers, regions: Numbers, weights: Array, places: Array) -> Supports:
        """Return the supports with other joints after these; the arguments are the attributes of these joints."""
        return replace(
            self,
            joints=np.append(self.joints, joints),
            regions=np.append(self.regions, regions),
            weights=np.hstack([self.weights, weights]),
            places=np.hstack([self.places, places]),
        )

    def __getitem__(self, frames: slice) -> Supports:
        if frames == slice(0, len(self.weights)):
            return self
        return replace(
            self,
            weights=self.weights[frames],
            places=self.places[frames],
            floor=self.floor.of_frames(frames),
            scene_springs=self.scene_springs.of_frames(frames),
            user_springs=self.user_springs.of_frames(frames),
        )


def no_supports(frames: int) -> Supports:
    """Return supports of a clip in which nothing rests."""
    none, springs = np.zeros(0, np.intp), no_springs(frames)
    return Supports(
        joints=none,
        regions=none,
        feet=0,
        weights=np.zeros((frames, 0)),
        places=np.zeros((frames, 0, 3)),
        floor=no_floor(frames),
        scene_springs=springs,
        user_springs=springs,
    )


def support_springs(supports: Supports, body: Articulation, bones: Array, unit: float, stiffness: float) -> Springs:
    """Return the springs of resting joints, frames first; `bones`, (frames, joints, 3), are the rotation copy's [body
    units], `unit` is the body unit [file units], and `stiffness` is k; 0 leaves the joints free.
    """
    weights, joints, regions, feet = supports.weights, supports.joints, supports.regions, supports.feet
    A = np.zeros((*weights.shape, 3, 3))
    if stiffness > 0.0:
        arms, M = np.zeros((len(body.stiffness), 3)), np.zeros((3, 3))
        write_holds(weights, joints, regions, feet, body, bones, stiffness, A, arms, M)
    return Springs(joints, np.full(len(joints), -1), supports.places / unit, A)
