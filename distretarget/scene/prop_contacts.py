"""Props among performers: where they are on the way, which joints touch them, and the springs that keep them there.

A prop keeps its shape, so that one similarity a frame takes all of the source's world around it to the target's: what
touches the prop belongs where that takes it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.baseline.rotation_copy import RootScale
from distretarget.ik.springs import Springs
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.rotations import nearest_rotations
from distretarget.numerics.vectors import lengths
from distretarget.objectives.contact_pairs import activation, pair_stiffness, share_across
from distretarget.objectives.settings import ContactSettings
from distretarget.scene.touch import Points, firmness

Array = NDArray[np.float64]
Joints = NDArray[np.intp]

LEVER = 0.02  # how far from a hand its turn counts for a prop that it holds [body units]
LOOSE = 1e-6  # how much the free place of a prop counts beside the hands that hold it


@dataclass(frozen=True, eq=False)
class Placement:
    """A similarity in each frame, which takes the source's world around a prop to the target's.

    Attributes:
        centre: (frames, 3), the middle of the prop in the source [source file units].
        place: (frames, 3), where that is [target file units].
        turn: (frames, 3, 3), the rotation about it.
        scale: target units per source unit.
    """

    centre: Array
    place: Array
    turn: Array
    scale: float

    def __call__(self, points: Array) -> Array:
        """The places of points (frames, points, 3)."""
        around = self.scale * (points - self.centre[:, None])
        return np.asarray(self.place[:, None] + around @ self.turn.swapaxes(1, 2))


class Grasp(NamedTuple):
    """A joint that holds a prop.

    Attributes:
        weight: (frames,), 1 while it holds the prop, blended to 0.
        source, now: (frames, 3), where it is in the source, and on its body [file units of each].
        turn: (frames, 3, 3), how its body's joint is turned against the source's, apart from the rest poses.
        lever: how far from it the turn counts [target file units].
    """

    weight: Array
    source: Array
    now: Array
    turn: Array
    lever: float


def free_placement(points: Array, scale: float, level: float, up: Array) -> Placement:
    """Where a prop is that nobody holds: the middle of its points, (frames, points, 3), where the world's scale takes
    it along the floor, and as high as its own scale says.
    """
    centre = points.mean(axis=1)
    turn = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    return Placement(centre, RootScale(level, scale).places(centre, up), turn, scale)


def held_placement(free: Placement, holds: Sequence[Grasp]) -> Placement:
    """Where a prop is that joints hold: as near as it can be to all of them, in place and turn (Kabsch fit)."""
    loose = np.maximum(1.0 - np.max([hold.weight for hold in holds], axis=0), LOOSE)
    weights = np.stack([loose, *(hold.weight for hold in holds)])[..., None]
    a = np.stack([0.0 * free.centre, *(free.scale * (hold.source - free.centre) for hold in holds)])
    b = np.stack([free.place, *(hold.now for hold in holds)])
    middle_a, middle_b = ((weights * x).sum(axis=0) / weights.sum(axis=0) for x in (a, b))
    H = np.einsum("hfi,hfj->fij", weights * (b - middle_b), a - middle_a)
    lever = max(hold.lever for hold in holds)
    H += (lever**2 * loose)[:, None, None] * np.eye(3)
    for hold in holds:
        H += (hold.lever**2 * hold.weight)[:, None, None] * hold.turn
    turn = nearest_rotations(H)
    return Placement(free.centre, middle_b - np.einsum("fij,fj->fi", turn, middle_a), turn, free.scale)


def turn_of(copy: Array, now: Array) -> Array:
    """(frames, 3, 3), how a joint is turned against the source's, given its world rotations, (frames, 4), in the copy
    and now: the copy turns as the source, apart from the rest poses.
    """
    return np.asarray((Rotation.from_quat(now) * Rotation.from_quat(copy).inv()).as_matrix())


@dataclass(frozen=True, eq=False, kw_only=True)
class Touched:
    """The joints of a performer that come near a prop.

    Attributes:
        joints: (joints,), of the target.
        source: (frames, joints, 3), where their drivers are in the source [source file units].
        gaps: (frames, joints), how far these are from the nearest point of the prop [source file units].
        f: (frames, joints), how far each is drawn to the prop, 0 to 1.
        A: (frames, joints, 3, 3), the stiffness.
    """

    joints: Joints
    source: Array
    gaps: Array
    f: Array
    A: Array

    def without(self, columns: NDArray[np.bool_]) -> Touched:
        """The same, with nothing that draws some of its joints, (joints,)."""
        return replace(self, A=np.where(columns[:, None, None], 0.0, self.A))

    def springs(self, placement: Placement, copy: Array, unit: float) -> Springs:
        """The springs that draw the joints to where they touch the prop; their arrays have the frames in front.

        `copy`, (frames, joints, 3), are the joints of the copy [target file units], `unit` is the body unit.
        """
        copied = copy[:, self.joints]
        places = copied + self.f[..., None] * (placement(self.source) - copied)
        return Springs(self.joints, np.full(len(self.joints), -1), places / unit, self.A)


def find_touched(
    points: Points,
    regions: Joints,
    prop: Array,
    leg: float,
    free: Array,
    frame_time: float,
    settings: ContactSettings,
) -> Touched:
    """Return the joints of a performer that come near the points of a prop, (frames, points, 3).

    The normalised distance of a joint is its distance from the nearest point over the length of a `leg` [source file
    units], since no path leads from it to the prop. Joints in the same of the `regions`, (points,), share their
    stiffness. `free`, (frames, points), is 0 where a joint is held elsewhere.
    """
    length = nearest(points.source, prop)
    D = length / leg
    f = activation(D, points.shots, settings.blend / frame_time, settings.reach) * free
    on = np.flatnonzero(f.any(axis=0))
    ends = np.arange(len(on)), len(on) + regions[on]
    f, D = f[:, on], D[:, on]
    w = firmness(D, settings) * pair_stiffness(f, D, ends, len(on) + int(regions.max(initial=0)) + 1, settings)
    w *= share_across((length[:, on] / (2.0 * leg)) ** 2)
    A = w[..., None, None] * np.eye(3)
    return Touched(joints=points.joints[on], source=points.source[:, on], gaps=length[:, on], f=f, A=A)


def nearest(joints: Array, prop: Array) -> Array:
    """(frames, joints), how far each joint is from the nearest point of a prop, (frames, points, 3)."""
    length = np.empty(joints.shape[:2])
    for block in blocks_of(len(joints)):
        length[block] = lengths(joints[block][:, :, None] - prop[block][:, None]).min(axis=-1)
    return length
