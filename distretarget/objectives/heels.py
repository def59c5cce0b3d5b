"""Heel lift: a long foot that stands on its toes is turned towards the floor, and its toes bend.

When a foot stands on its toes, a longer foot lifts its ankle higher. If only one foot does so, no height of the hips
suits both legs: the knee above the longer foot bends more than the source's, and hips that follow the ankles jolt.
Therefore each bone of a resting foot is turned from its direction b towards its direction in a flat foot by

    share (angle from flat to b) b x n,    share = 1 - (lift of the source's heel, scaled + ROLL) / (own lift + ROLL)

with n the normal of the sole: a rotation about the sideways axis of the foot, even if the foot points straight down. A
foot on its edge or back would roll over in this way. Therefore n is blended into the direction up as the sole turns
away from the floor; a bone that points straight down then does not turn. The angle falls to 0 for a foot whose sole
faces upwards. The heel lift that remains raises the hips (`foot_lock.hips_rise`).

If the source's feet end at the ball, nothing drives the target's toes. They would point into the floor with the foot
and lift the ankle by their length. In resting feet, toes therefore turn up to their direction in a flat foot, never
down.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import compress

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.resting import feet_resting
from distretarget.ik.poses import posed_motion
from distretarget.matching.undersides import Undersides
from distretarget.numerics.quaternions import turned_by
from distretarget.numerics.time_series import smoothstep
from distretarget.numerics.vectors import Array, cross
from distretarget.objectives.clip import Clip, LegPair
from distretarget.objectives.foot_lock import ROLL, heel_lift, lowest_of_foot, sole_levels
from distretarget.objectives.supports import BLEND

FACING = 0.5  # a sole faces the floor if its unit normal has at least this upward component: 60 degrees from flat


def with_low_heels(clip: Clip, undersides: Undersides | None = None) -> Clip:
    """Return the clip with the feet of its rotation copy less steep where they rest and lift their heels higher than
    the source's, scaled; by their mesh, if there is one. Undriven toes are bent first.
    """
    rests = [feet_resting(clip.source, pair.source, clip.up, clip.leg_lengths[0], clip.shots) for pair in clip.legs]
    firm = [clip.widened(resting, BLEND).max(axis=1) for resting in rests]
    clip = _with_bent_toes(clip, firm)
    v = np.zeros((len(clip), clip.parts.max() + 2, 3))
    for pair, rest, lifts in zip(clip.legs, firm, _lifts(clip, undersides, rests), strict=True):
        lift, own_lift = (np.maximum(each, 0.0) + ROLL * clip.leg_lengths[1] for each in lifts)
        share = np.maximum(1.0 - lift / own_lift, 0.0) * np.minimum(1.0 + _normals(clip, pair) @ clip.up, 1.0)
        _turn_to_flat(clip, pair, rest * share, v)
    if not v.any():
        return clip
    v = clip.averaged(v, BLEND)
    return replace(clip, copy=posed_motion(clip.copy, v, clip.parts, clip.copy.root_positions))


def _with_bent_toes(clip: Clip, firm: Sequence[Array]) -> Clip:
    """The clip with the undriven toes of resting feet turned up; `firm`, (frames,) for each leg, is the weight of its
    foot, 0 to 1.
    """
    rotations = clip.copy.rotations.copy()
    bend = [_toes_bend(clip, pair) for pair in clip.legs]
    for pair, rest in compress(zip(clip.legs, firm, strict=True), bend):
        ankle, toe = pair.target.ankle, pair.target.toe
        angle, axis = _to_flat(clip, pair, ankle, toe)
        turn = Rotation.from_rotvec(clip.averaged((rest * np.maximum(angle, 0.0))[:, None] * axis, BLEND))
        foot = Rotation.from_quat(clip.copy.world_rotations_of(ankle))
        rotations[:, toe] = (foot.inv() * turn * foot * Rotation.from_quat(rotations[:, toe])).as_quat()
    return replace(clip, copy=replace(clip.copy, rotations=rotations)) if any(bend) else clip


def _toes_bend(clip: Clip, pair: LegPair) -> bool:
    """Whether the target's foot has one toe joint that can turn, and the source's foot ends there."""
    skeleton, foot = clip.skeleton, pair.target
    ends = clip.source_skeleton.end_sites[pair.source.toe] and not skeleton.end_sites[foot.toe]
    return bool(ends and skeleton.children[foot.ankle] == (foot.toe,) and len(skeleton.rotation_axes(foot.toe)) == 3)


def _lifts(clip: Clip, undersides: Undersides | None, rests: Sequence[Array]) -> Iterator[tuple[Array, Array]]:
    """For each leg, the heel lifts of the source, scaled, and of the copy, (frames,) each [target file units]: height
    of the ankle over the sole's lowest point, less that in a flat foot. `rests` is how much ankle and toe rest,
    (frames, 2) for each leg.
    """
    scale, up = clip.scale.height, clip.up
    if undersides is None or not undersides.feet_on_mesh:
        for pair in clip.legs:
            yield scale * heel_lift(clip.source, pair.source_sole, up), heel_lift(clip.copy, pair.target_sole, up)
        return
    for level, pair in zip(sole_levels(clip, rests).T, clip.legs, strict=True):
        lift = clip.source.positions[:, pair.source.ankle] @ up - level - pair.source_sole.ankle
        lowest = lowest_of_foot(clip.copy, pair.target.ankle, pair.target_sole, up, undersides) + undersides.soles[1]
        yield scale * lift, clip.copy.positions[:, pair.target.ankle] @ up - lowest - pair.target_sole.ankle


def _turn_to_flat(clip: Clip, pair: LegPair, share: Array, v: Array) -> None:
    """Write to v, (frames, parts + 1, 3), the rotation vectors that turn the bones of a foot by a share, (frames,), of
    the angles to their directions in a flat foot [rad].
    """
    joints, skeleton, to_toe = pair.target_sole.joints.tolist(), clip.skeleton, clip.skeleton.to_root(pair.target.toe)
    for joint in sorted(joints, key=to_toe.__contains__):  # a part takes the angle of its bone to the toe
        above = int(skeleton.parents[joint])
        if above in joints and skeleton.lengths[joint] > 0.0:
            angle, axis = _to_flat(clip, pair, above, joint)
            v[:, clip.parts[above]] = (share * angle)[:, None] * axis


def _to_flat(clip: Clip, pair: LegPair, upper: int, lower: int) -> tuple[Array, Array]:
    """The angle by which a bone of a foot has to turn upwards to its slope in a flat foot, (frames,) [rad], and the
    axis to turn about, (frames, 3); the axis is shorter where bone and upward direction are nearly parallel.
    """
    sole, length = pair.target_sole, float(clip.skeleton.lengths[lower])
    flat = np.subtract(*(sole.heights[sole.joints == joint].item() for joint in (lower, upper)))
    bone = (clip.copy.positions[:, lower] - clip.copy.positions[:, upper]) / length
    angle, own_angle = (np.arcsin(np.clip(sine, -1.0, 1.0)) for sine in (flat / length, bone @ clip.up))
    normals = _normals(clip, pair)
    upwards = clip.up + smoothstep(normals @ clip.up / FACING)[:, None] * (normals - clip.up)
    return angle - own_angle, cross(bone, upwards)


def _normals(clip: Clip, pair: LegPair) -> Array:
    """(frames, 3), the unit normals of the sole of the copied foot, upwards."""
    return turned_by(clip.copy.world_rotations_of(pair.target.ankle), pair.target_sole.normal)
