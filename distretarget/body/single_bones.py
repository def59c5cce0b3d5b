"""Limbs of one bone, as in figures of blocks: their End Sites, and the straightening of a source's limbs for them.

A straight leg reaches farther than a bent one. Therefore the hips rise by the depth of the ankles of standing legs
below their floor, averaged over time. An ankle's floor is its height while the foot rests, interpolated between
rests, and never above the ankle. Legs that do not point down, such as those of a person who sits, turn up instead.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from distretarget.body.anatomy import LIMBS, Anatomy
from distretarget.body.body import Body
from distretarget.body.conventions import NamedTree
from distretarget.body.limbs import Leg
from distretarget.body.named_anatomy import by_tree
from distretarget.body.resting import feet_at_rest
from distretarget.motion import Motion
from distretarget.numerics.moving import averaged
from distretarget.numerics.time_series import by_shot, smoothstep
from distretarget.numerics.vectors import Array, angles_between, lengths, level, normalised
from distretarget.skeleton import SMALLEST, Skeleton
from distretarget.skin.limbs import bent
from distretarget.skin.mesh import MeshReader

# The body stands on a leg within the first angle of straight down, and not on one beyond the second [rad].
STANDING, RAISED = np.radians(25), np.radians(45)
RISE_BLEND = 0.1  # the rise is averaged over this time before and after a frame [s]


def single_bones(anatomy: Anatomy | None) -> Iterator[tuple[str, ...]]:
    """Yield the roles of upper bone, lower bone and end of each limb of an anatomy without a lower bone."""
    roles = anatomy.roles if anatomy else {}
    return (parts for parts in LIMBS if parts[0] in roles and parts[1] not in roles)


def with_ends(skeleton: Skeleton, mesh: MeshReader) -> Skeleton:
    """Return a skeleton with an End Site added to each limb of one bone that has no end. It is where the limb's skin in
    the `mesh` ends: straight below the hip, or along the longest axis of an arm's skin.
    """
    body = Body.of(skeleton) if any(single_bones(by_tree(NamedTree.of(skeleton), single=True))) else None
    endless = [parts for parts in single_bones(body.anatomy) if parts[2] not in body.roles] if body else []
    skin = mesh() if endless else None
    if body is None or skin is None:
        return skeleton
    tops, offsets = [body.roles[parts[0]] for parts in endless], []
    for top, (_, _, end) in zip(tops, endless, strict=True):
        points = skin.vertices[np.unique(skin.firsts[skin.carriers == top])] - skeleton.rest_positions[top]
        points = points if len(points) else np.zeros((1, 3))
        is_leg = end.endswith("Foot")
        along = -body.up_vector if is_leg else np.linalg.svd(points - points.mean(axis=0))[2][0]
        reach = points @ along
        offsets.append((reach.max() if is_leg or reach.mean() > 0.0 else reach.min()) * along)
    return replace(
        skeleton,
        names=(*skeleton.names, *(f"{skeleton.names[top]}_End" for top in tops)),
        parents=np.append(skeleton.parents, tops),
        offsets=np.vstack([skeleton.offsets, *offsets]),
        channels=(*skeleton.channels, *((),) * len(tops)),
        end_sites=np.append(skeleton.end_sites, np.ones(len(tops), bool)),
    )


def on_ends(motion: Motion, mesh: MeshReader) -> Motion:
    """Return the motion on the skeleton `with_ends`."""
    skeleton, count = with_ends(motion.skeleton, mesh), len(motion.skeleton)
    still = np.tile(skeleton.rest_rotations[count:], (len(motion), 1, 1))
    return replace(motion, skeleton=skeleton, rotations=np.hstack([motion.rotations, still])) if still.size else motion


def straightened(source: Body, target: Body) -> Body:
    """Return the source with limbs straightened that are single bones on the target."""
    motion, roles, up = source.motion, source.roles, source.up_vector
    known = {roles.get(top) for top, *_ in single_bones(target.anatomy)}
    limbs = [limb for limb in source.limbs if limb.top in known]
    if motion is None or not limbs:
        return source
    legs, low = {leg.hip: leg for leg in source.legs or ()}, np.zeros((len(motion), len(limbs)))
    tops, middles, ends = (motion.positions[:, joints] for joints in np.transpose([limb.joints for limb in limbs]))
    upper, whole = lengths(middles - tops), lengths(middles - tops) + lengths(ends - middles)
    straight = whole[..., None] * normalised(ends - tops)
    for number, limb in enumerate(limbs):
        if limb.top in legs:
            floor = _floor(motion, legs[limb.top], up, source.leg_length)
            low[:, number] = floor - (tops + straight)[:, number] @ up
    angles = angles_between(straight, np.broadcast_to(-up, straight.shape))
    raised = smoothstep((angles - STANDING) / (RAISED - STANDING))
    rise = ((1.0 - raised) * low).max(axis=1, initial=0.0)
    rise = by_shot(partial(averaged, reach=round(RISE_BLEND / motion.frame_time)), source.shots_of(motion), rise)
    height = straight @ up + np.maximum(raised * (low - rise[:, None]), 0.0)
    width = np.sqrt(np.maximum(whole**2 - height**2, 0.0))
    straight = width[..., None] * normalised(level(straight, up)) + height[..., None] * up
    at_middles = tops + (upper / np.maximum(whole, SMALLEST))[..., None] * straight
    moved = np.stack([at_middles - middles, tops + straight - ends], axis=2)
    return source.with_motion(bent(motion, limbs, moved).moved(np.outer(rise, up)), source.up)


def _floor(motion: Motion, leg: Leg, up: Array, length: float) -> Array:
    """The height of the floor under an ankle, (frames,); `length` is that of a leg [file units]."""
    heights = motion.positions[:, leg.ankle] @ up
    rests = np.flatnonzero(feet_at_rest(motion, leg, up, length).any(axis=1))
    floor = np.interp(np.arange(len(motion)), rests, heights[rests]) if len(rests) else heights.min()
    return np.asarray(np.minimum(heights, floor))
