"""The arms of a body: how they hang, and in which frames they are raised or bent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import ARM, SIDES, Anatomy
from distretarget.numerics.time_series import smoothstep
from distretarget.numerics.vectors import angles_between, lengths
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]
Joints = NDArray[np.intp]

# An arm hangs while the angles of shoulder and elbow add up to less than the first angle; it is raised or bent from
# the second one on [rad].
RELAXED = np.radians(60)
RAISED = np.radians(100)


@dataclass(frozen=True)
class Arm:
    """The joints of an arm."""

    shoulder: int  # the upper end of the upper arm
    elbow: int
    wrist: int


def find_arms(anatomy: Anatomy | None) -> tuple[Arm, ...]:
    """Return the arms that have all three joints; none without an anatomy."""
    roles = anatomy.roles if anatomy else {}
    arms = ([side + part for part in ARM[1:]] for side in SIDES)
    return tuple(Arm(*(roles[role] for role in arm)) for arm in arms if roles.keys() >= {*arm})


def with_hanging_arms(skeleton: Skeleton, places: Array, arms: tuple[Arm, ...], up: Array) -> Array:
    """Return the places of all joints, (joints, 3) [file units], with each arm straight down from its shoulder; `up`,
    (3,), is the unit vector up.
    """
    places = np.array(places)
    for arm in arms:
        below = skeleton.subtree(arm.shoulder)
        places[below] = places[arm.shoulder] - np.outer(skeleton.paths_from(arm.shoulder)[below], up)
    return places


def hanging_distances(hanging: Array | None, u: Joints, v: Joints, tau: Array) -> Array:
    """Return D of joints u and v, (pairs,) each, over the path lengths `tau`, (pairs,), in a body with hanging arms,
    whose joints are at `hanging`, (joints, 3); infinite where that is not known.
    """
    return np.full(len(u), np.inf) if hanging is None else lengths(hanging[u] - hanging[v]) / tau


def raised(positions: Array, arm: Arm, hips: list[int], up: Array) -> Array:
    """Return how far an arm is raised or bent in each frame, (frames,): 0 while it hangs, 1 from the angle `RAISED` on.

    The angle is that of the upper arm from straight down, by gravity or along the trunk, whichever is less, plus that
    of the elbow. `positions`, (frames, joints, 3), are the body's; `hips` its hip joints; `up` the unit vector up.
    """
    upper = positions[:, arm.elbow] - positions[:, arm.shoulder]
    lower = positions[:, arm.wrist] - positions[:, arm.elbow]
    angle = angles_between(upper, np.broadcast_to(-up, upper.shape))
    if hips:
        trunk = positions[:, hips].mean(axis=1) - positions[:, arm.shoulder]
        angle = np.minimum(angle, angles_between(upper, trunk))
    return smoothstep((angle + angles_between(upper, lower) - RELAXED) / (RAISED - RELAXED))
