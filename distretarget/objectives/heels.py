"""How far heels lift: a foot that is longer than the source's is less steep on its toes, and its toes bend.

On its toes a foot is a lever: the longer it is, the higher is its ankle. Where one foot alone stands on its toes, no
height of the hips suits both legs then, and the knee above the longer foot bends more than the source's; hips that
follow the ankles jolt. So each bone of a foot that rests, from b to where it points in a flat foot, is turned by

    share (angle from flat to b) b x n,    share = 1 - (lift of the source's heel, scaled + ROLL) / (own lift + ROLL)

with n the normal of the sole: about the foot's own side, also where it points straight down. A foot on its edge or back
would roll over that way, so n gives way to the direction up as the sole turns from the floor: a bone that points
straight down does not turn then, as it shows no way back. By less, down to nothing, turns a foot whose sole faces
upwards. What is left is the hips' (`foot_lock.hips_rise`).

A source whose feet end at the ball shows nothing of the toes, which would point into the floor with the foot and lift
the ankle by their length. They bend where the foot stands on them: they turn back all the way, but never downwards.
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

FACING = 0.5  # a sole faces the floor if its normal points upwards by this or more, as up to 60 degrees from flat


def with_low_heels(clip: Clip, undersides: Undersides | None = None) -> Clip:
    """Return the clip with the feet of its rotation copy less steep where they rest and their heels are higher than the
    source's, scaled: those of their mesh, if there is one. Toes that nothing turns bend first.
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
    """The clip with toes bent that can turn, where the source has no joint that turns them; `firm`, (frames,) for each
    leg, is how firmly its foot rests, 0 to 1.
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
    """Whether the target's foot carries toes that can turn, and nothing beside them, and the source's ends there."""
    skeleton, foot = clip.skeleton, pair.target
    ends = clip.source_skeleton.end_sites[pair.source.toe] and not skeleton.end_sites[foot.toe]
    return bool(ends and skeleton.children[foot.ankle] == (foot.toe,) and len(skeleton.rotation_axes(foot.toe)) == 3)


def _lifts(clip: Clip, undersides: Undersides | None, rests: Sequence[Array]) -> Iterator[tuple[Array, Array]]:
    """For each leg, how much higher over what the sole is on the ankle is than in a foot that stands flat, (frames,)
    each: the source's, scaled, and the copy's [target file units]. `rests` is how much ankle and toe rest, (frames, 2).
    """
    scale, up = clip.scale.height, clip.up
    if undersides is None or not undersides.feet_have_mesh:
        for pair in clip.legs:
            yield scale * heel_lift(clip.source, pair.source_sole, up), heel_lift(clip.copy, pair.target_sole, up)
        return
    for level, pair in zip(sole_levels(clip, rests).T, clip.legs, strict=True):
        lift = clip.source.positions[:, pair.source.ankle] @ up - level - pair.source_sole.ankle
        lowest = lowest_of_foot(clip.copy, pair.target.ankle, pair.target_sole, up, undersides) + undersides.soles[1]
        yield scale * lift, clip.copy.positions[:, pair.target.ankle] @ up - lowest - pair.target_sole.ankle


def _turn_to_flat(clip: Clip, pair: LegPair, share: Array, v: Array) -> None:
    """Write to v, (frames, parts + 1, 3), the rotations that turn the bones of a foot, by a share, (frames,), of their
    angles, towards where they point in a flat foot [rad].
    """
    joints, skeleton, to_toe = pair.target_sole.joints.tolist(), clip.skeleton, clip.skeleton.to_root(pair.target.toe)
    for joint in sorted(joints, key=to_toe.__contains__):  # of the bones of one part that to the toe counts
        above = int(skeleton.parents[joint])
        if above in joints and skeleton.lengths[joint] > 0.0:
            angle, axis = _to_flat(clip, pair, above, joint)
            v[:, clip.parts[above]] = (share * angle)[:, None] * axis


def _to_flat(clip: Clip, pair: LegPair, upper: int, lower: int) -> tuple[Array, Array]:
    """How far a bone of a foot turns upwards to where it points in a flat foot, (frames,) [rad], and the axis about
    which it turns, (frames, 3), which is shorter the less the bone shows it.
    """
    sole, length = pair.target_sole, float(clip.skeleton.lengths[lower])
    flat = np.subtract(*(sole.heights[sole.joints == joint].item() for joint in (lower, upper)))
    bone = (clip.copy.positions[:, lower] - clip.copy.positions[:, upper]) / length
    angle, own_angle = (np.arcsin(np.clip(sine, -1.0, 1.0)) for sine in (flat / length, bone @ clip.up))
    normals = _normals(clip, pair)
    upwards = clip.up + smoothstep(normals @ clip.up / FACING)[:, None] * (normals - clip.up)
    return angle - own_angle, cross(bone, upwards)


def _normals(clip: Clip, pair: LegPair) -> Array:
    """(frames, 3), the unit vectors up from the sole of the copied foot."""
    return turned_by(clip.copy.world_rotations_of(pair.target.ankle), pair.target_sole.normal)
