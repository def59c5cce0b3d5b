"""How far heels lift: a foot that is longer than the source's is less steep on its toes.

On its toes a foot is a lever: the longer it is, the higher is its ankle. Where one foot alone stands on its toes, no
height of the hips suits both legs then, and the knee above the longer foot bends more than the source's; hips that
follow the ankles jolt. So each bone of a foot that rests, from b to where it points in a flat foot, is turned by

    share (angle from flat to b) b x n,    share = 1 - (lift of the source's heel, scaled + ROLL) / (own lift + ROLL)

with n the normal of the sole: about the foot's own side, also where it points straight down. A foot on its edge or back
would roll over that way, so n gives way to the direction up as the sole turns from the floor: a bone that points
straight down does not turn then, as it shows no way back. By less, down to nothing, turns a foot whose sole faces
upwards. What is left is the hips' (`foot_lock.hips_rise`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

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
    source's, scaled: those of their mesh, if there is one.
    """
    v = np.zeros((len(clip), clip.parts.max() + 2, 3))
    rests = [feet_resting(clip.source, pair.source, clip.up, clip.leg_lengths[0], clip.shots) for pair in clip.legs]
    for pair, resting, lifts in zip(clip.legs, rests, _lifts(clip, undersides, rests), strict=True):
        lift, own_lift = (np.maximum(each, 0.0) + ROLL * clip.leg_lengths[1] for each in lifts)
        normals = turned_by(clip.copy.world_rotations_of(pair.target.ankle), pair.target_sole.normal)
        share = np.maximum(1.0 - lift / own_lift, 0.0) * np.minimum(1.0 + normals @ clip.up, 1.0)
        rest = clip.widened(resting, BLEND).max(axis=1)
        _turn_to_flat(clip, pair, rest * share, normals, v)
    if not v.any():
        return clip
    v = clip.averaged(v, BLEND)
    return replace(clip, copy=posed_motion(clip.copy, v, clip.parts, clip.copy.root_positions))


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


def _turn_to_flat(clip: Clip, pair: LegPair, share: Array, normals: Array, v: Array) -> None:
    """Write to v, (frames, parts + 1, 3), the rotations that turn the bones of a foot, by a share, (frames,), of their
    angles, towards where they point in a flat foot [rad]; `normals`, (frames, 3), are those of the sole.
    """
    sole, skeleton = pair.target_sole, clip.skeleton
    upwards = clip.up + smoothstep(normals @ clip.up / FACING)[:, None] * (normals - clip.up)
    flat, to_toe = dict(zip(sole.joints.tolist(), sole.heights.tolist(), strict=True)), skeleton.line(pair.target.toe)
    for joint in sorted(flat, key=to_toe.__contains__):  # of the bones of one part that to the toe counts
        above, length = int(skeleton.parents[joint]), float(skeleton.lengths[joint])
        if above in flat and length > 0.0:
            bone = (clip.copy.positions[:, joint] - clip.copy.positions[:, above]) / length
            angle = np.arcsin(np.clip((flat[joint] - flat[above]) / length, -1.0, 1.0))
            own_angle = np.arcsin(np.clip(bone @ clip.up, -1.0, 1.0))
            v[:, clip.parts[above]] = (share * (angle - own_angle))[:, None] * cross(bone, upwards)
