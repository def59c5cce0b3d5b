"""User constraints as springs and supports: contacts, distances and planted parts, and how far a motion misses them.

A spring of weight s brings the offset of its joints by the share s from the rotation copy's to the constraint's,
however stiff the body:

    A = (M (1 - s) / s + I / k)^-1,

where M is the compliance of the body between the two joints, as in `supports`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.contact_entries import Contact, Distance, Entry, Plant
from distretarget.ik.holds import LEAST_WEIGHT
from distretarget.ik.springs import Springs, joined
from distretarget.matching.undersides import Undersides
from distretarget.motion import Motion
from distretarget.numerics.vectors import Array, Flags, Numbers, lengths, level, normalised
from distretarget.objectives.body_skin import BodySkin, Skins
from distretarget.objectives.clip import Clip
from distretarget.objectives.constraints import Carrier, Constraint, Constraints
from distretarget.objectives.contact import part_stiffness
from distretarget.objectives.mesh_gaps import FARTHEST
from distretarget.objectives.skin import SkinGap
from distretarget.objectives.supports import STIFFNESS, Supports
from distretarget.skin.balls import nearest_skin
from distretarget.skin.capsules import GROUP, IS_ARM

OFFSET_SPAN = 0.3  # target offsets of joints are averaged over this time before and after [s]
FACING = 0.1  # directions from skin to skin are averaged over this time before and after [s]
SEEN = 7  # about this many frames decide the gap between anchors
LEAST_LENGTH = 1e-6  # joints that are nearer to each other have no direction between them [body units]


def with_constraints(
    supports: Supports,
    constraints: Constraints,
    offsets: Sequence[Array | None],
    skins: Skins | None,
    undersides: Undersides | None,
) -> Supports:
    """Return supports with those of user constraints; `skins` and `undersides` are None for bodies without thickness.

    `offsets`, (frames, 3) each [body units], are the target offsets between the joints of each constraint; None for a
    constraint whose offset is to be found from the rotation copy.
    """
    springs, clip = [supports.user_springs], constraints.clip
    for constraint, offset in zip(constraints, offsets, strict=True):
        firmness, pair = constraints.firmness(constraint), constraint.pair
        if pair is not None:
            if offset is None:
                now = joint_offset(clip.copy, pair, clip)
                offset = now + correction(constraints, constraint, clip.copy, supports, skins)
            springs.append(_spring(clip, pair, clip.averaged(offset, OFFSET_SPAN), firmness))
        elif isinstance(constraint.entry, Plant) and not constraint.entry.keep:
            released = firmness[:, None] * np.isin(supports.joints, constraint.joints[0])
            supports = replace(supports, weights=supports.weights * (1.0 - released))
        elif isinstance(constraint.entry, Plant):
            supports = _planted(supports, clip, constraint, firmness, undersides, skins)
    return replace(supports, user_springs=joined(*springs))


def joint_offset(motion: Motion, pair: tuple[int, int], clip: Clip) -> Array:
    """(frames, 3), the offset of the first joint of a pair from the second [body units]."""
    a, b = pair
    return np.asarray((motion.positions[:, a] - motion.positions[:, b]) / clip.unit)


def correction(
    constraints: Constraints, constraint: Constraint, motion: Motion, supports: Supports, skins: Skins | None
) -> Array:
    """Return the displacement that a constraint needs in a motion, (frames, 3) [body units]: of its first joint
    relative to its second, or of a part planted on the world; 0 for all other entries.
    """
    clip, entry, pair = constraints.clip, constraint.entry, constraint.pair
    if pair is None:
        columns = np.flatnonzero(np.isin(supports.joints, constraint.joints[0]) & isinstance(entry, Plant))
        if not len(columns) or not getattr(entry, "keep", False):
            return np.zeros((len(motion), 3))
        needed = supports.places[:, columns] - motion.positions[:, supports.joints[columns]]
        return np.asarray(needed[np.arange(len(motion)), lengths(needed).argmax(axis=1)] / clip.unit)
    if constraint.anchors is not None and isinstance(entry, Contact):
        one, other, gap_offset = constraint.anchors
        gap = constraints.length(float(entry.gap or 0.0)) + gap_offset
        apart = gap * normalised(other.normals(motion) - one.normals(motion))
        return np.asarray(apart - (one.places(motion) - other.places(motion)) / clip.unit)
    now = joint_offset(motion, pair, clip)
    if isinstance(entry, Plant):
        assert constraint.carrier is not None
        return _resting_offset(clip, constraint, constraint.carrier, motion, pair, skins) - now
    if isinstance(entry, Contact):
        if skins is not None and (of_skins := target_gap(constraints, constraint, skins)):
            return _gap_change(clip, constraint, motion, skins.target, *of_skins)
        if entry.gap and entry.gap != "source":
            now = _nearest_offset(motion, constraint.joints) / clip.unit
    distance = lengths(now)
    direction = np.where(distance[:, None] > LEAST_LENGTH, normalised(now), clip.up)
    return np.asarray((_target_distance(constraints, entry, pair) - distance)[:, None] * direction)


def _target_distance(constraints: Constraints, entry: Entry, pair: tuple[int, int]) -> Array | float:
    """The distance that a constraint sets between two joints, one for all frames or (frames,) [body units]."""
    if isinstance(entry, Distance):
        return constraints.length(entry.value)
    if isinstance(entry, Contact) and entry.gap != "source":
        return constraints.length(float(entry.gap or 0.0))
    clip = constraints.clip
    u, v = clip.drivers[[*pair]]
    tau, own_tau = clip.skeleton.paths_from(pair[0])[pair[1]], clip.source_skeleton.paths_from(int(u))[v]
    source = lengths(clip.source.positions[:, u] - clip.source.positions[:, v])
    return np.asarray(tau / max(own_tau, LEAST_LENGTH) / clip.unit * source)


def with_gaps(constraints: Constraints, motion: Motion, body: BodySkin) -> Constraints:
    """Return constraints whose anchors have a `gap_offset` with which the least gap between the two skins is the
    user's, found from a motion that meets them: the fingers of a hand may touch before its palm does.
    """
    return replace(constraints, every=tuple(_with_gap(constraints, each, motion, body) for each in constraints))


def _with_gap(constraints: Constraints, constraint: Constraint, motion: Motion, body: BodySkin) -> Constraint:
    entry, on = constraint.entry, np.flatnonzero(constraint.frames)
    if not constraint.anchors or not isinstance(entry, Contact):
        return constraint
    pairs = body.between(*(_touching(body, point.joint) for point in constraint.anchors[:2]))
    if not len(pairs):
        return constraint
    some = motion[on[:: -(-len(on) // SEEN)]]
    limbs, others = body.balls.pairs[pairs].T
    if body.surface is None:
        gaps, _ = nearest_skin(body.balls, body.posed(some), pairs)
    else:
        parts = [(limb, tuple(others[limbs == limb].tolist())) for limb in np.unique(limbs).tolist()]
        wanted = np.ones((len(some), len(parts)), bool)
        gaps = body.surface.gaps(some, parts, wanted, FARTHEST * body.unit).min(axis=1) / body.unit
    farther = constraints.length(float(entry.gap or 0.0)) - float(np.median(np.minimum(gaps, FARTHEST)))
    return replace(constraint, anchors=constraint.anchors._replace(gap_offset=constraint.anchors.gap_offset + farther))


def _touching(body: BodySkin, joint: int) -> Flags:
    """(joints,), a mask of the joints of a joint's segment if that is on an arm, else of its group of segments."""
    own, of_joint = body.of_joint[joint], body.of_joint
    return np.asarray(of_joint == own if IS_ARM[own] else GROUP[of_joint] == GROUP[own])


def eased_gap(constraints: Constraints, constraint: Constraint, skins: Skins, motion: Motion) -> SkinGap | None:
    """Return the gap between skins that a user contact sets, blended by the weight of the contact from the gap in a
    motion; None if it sets none.
    """
    of_skins = target_gap(constraints, constraint, skins)
    if of_skins is None:
        return None
    on, gap = of_skins
    own, _ = nearest_skin(skins.target.balls, skins.target.posed(motion), on)
    return SkinGap(
        on, (1.0 - constraint.weight) * np.maximum(own, 0.0) + constraint.weight * gap, np.sqrt(constraint.weight)
    )


def target_gap(constraints: Constraints, constraint: Constraint, skins: Skins) -> tuple[Numbers, Array] | None:
    """Return the segment pairs between which a user contact sets the gap of skins, and the gap, (frames,) [body units];
    None if it sets none, or between anchors.
    """
    entry = constraint.entry
    if not isinstance(entry, Contact) or constraint.anchors:
        return None
    on = skins.target.between(*constraint.joints)
    if not len(on):
        return None
    if entry.gap != "source":
        return on, np.full(len(constraints.clip), constraints.length(float(entry.gap or 0.0)))
    drivers = constraints.clip.drivers
    of_source = skins.source.between(*(np.setdiff1d(drivers[joints], [-1]) for joints in constraint.joints))
    gaps, _ = nearest_skin(skins.source.balls, skins.source.posed(constraints.clip.source), of_source)
    return on, np.maximum(gaps, 0.0) if len(of_source) else np.zeros(len(gaps))


def _gap_change(clip: Clip, constraint: Constraint, motion: Motion, body: BodySkin, on: Numbers, gap: Array) -> Array:
    """(frames, 3), the displacement of a contact's first part that gives the pairs `on` this gap [body units]."""
    own, away = nearest_skin(body.balls, body.posed(motion), on, body.of_joint[constraint.joints[0]])
    return np.asarray((gap - own)[:, None] * normalised(clip.averaged(away, FACING)))


def _nearest_offset(motion: Motion, parts: Sequence[Numbers]) -> Array:
    """(frames, 3), the shortest offset of a joint of the first of two parts from a joint of the second."""
    offsets = motion.positions[:, parts[0], None] - motion.positions[:, None, parts[1]]
    offsets = offsets.reshape(len(motion), -1, 3)
    return np.asarray(offsets[np.arange(len(motion)), lengths(offsets).argmin(axis=1)])


def _resting_offset(
    clip: Clip, constraint: Constraint, carrier: Carrier, motion: Motion, pair: tuple[int, int], skins: Skins | None
) -> Array:
    """(frames, 3), the offset of a part from the joint of the body that it rests on and moves with [body units]."""
    own = _turns_of(clip.copy, carrier.joint).inv().apply(joint_offset(clip.copy, pair, clip))
    thick = 0.0 if skins is None else sum(skins.target.thickness(joint) for joint in pair)
    offset = thick * normalised(own[constraint.frames].mean(axis=0)[None])[0]
    return np.asarray(_turns_of(motion, carrier.joint).apply(offset))


def _spring(clip: Clip, pair: tuple[int, int], offset: Array, firmness: Array) -> Springs:
    """The spring that brings two joints to an offset, (frames, 3) [body units]."""
    A = np.zeros((len(clip), 1, 3, 3))
    on = firmness > LEAST_WEIGHT
    s = firmness[on, None, None]
    A[on, 0] = np.linalg.inv(_compliance(clip, pair, on) * (1.0 - s) / s + np.eye(3) / STIFFNESS)
    a, b = pair
    return Springs(np.array([a]), np.array([b]), offset[:, None], A)


def _compliance(clip: Clip, pair: tuple[int, int], on: Flags) -> Array:
    """M: (frames, 3, 3), the displacement of the first joint relative to the second per force, in the frames `on`."""
    h = part_stiffness(clip)
    bones, skeleton = clip.copy.bones[on] / clip.unit, clip.skeleton
    arms = np.zeros((len(bones), len(h) - 1, 3))
    for end, sign in zip(pair, (1.0, -1.0), strict=True):
        for joint in skeleton.to_root(end):
            if joint > 0:
                arms[:, clip.parts[skeleton.parents[joint]]] += sign * bones[:, joint]
    square = ((arms**2).sum(axis=2) / h[:-1]).sum(axis=1)
    return np.asarray(square[:, None, None] * np.eye(3) - np.einsum("fpi,fpj,p->fij", arms, arms, 1.0 / h[:-1]))


# ---- parts planted on the world, on props and on other performers


def _planted(
    supports: Supports,
    clip: Clip,
    constraint: Constraint,
    firmness: Array,
    undersides: Undersides | None,
    skins: Skins | None,
) -> Supports:
    """The supports with a part that is planted with a weight, `firmness`, (frames,)."""
    columns = np.flatnonzero(np.isin(supports.joints[: supports.feet], constraint.joints[0]))
    if not len(columns):
        first = constraint.joints[0][:1]
        if not np.isin(first, supports.joints):
            nowhere = np.zeros((len(clip), 1))
            supports = supports.with_joints(first, clip.regions.of_joint[first], nowhere, clip.copy_on_path(first))
        columns = np.flatnonzero(supports.joints == first)
    joints, on = supports.joints[columns], np.flatnonzero(constraint.frames)
    copy = clip.copy_on_path(joints)
    goal = _goal(supports, clip, constraint, columns, copy, undersides, skins)
    edge = np.clip(np.arange(len(clip)), on[0], on[-1])  # outside of the entry's frames the goal moves with the copy
    goal = copy + (goal - copy)[edge]
    weights, places, w = np.array(supports.weights), np.array(supports.places), firmness[:, None]
    places[:, columns] += w[..., None] * (goal - places[:, columns])
    weights[:, columns] = np.maximum(weights[:, columns], w)
    return replace(supports, weights=weights, places=places)


def _goal(
    supports: Supports,
    clip: Clip,
    constraint: Constraint,
    columns: Numbers,
    copy: Array,
    undersides: Undersides | None,
    skins: Skins | None,
) -> Array:
    """(frames, columns, 3), the places of planted joints [target file units]; `copy` are their places in the copy."""
    entry, joints, on = constraint.entry, supports.joints[columns], constraint.frames
    assert isinstance(entry, Plant)
    if constraint.carrier is not None:
        thick = 0.0 if skins is None else skins.target.thickness(int(joints[0])) * clip.unit
        return _carried(constraint.carrier, copy, on, thick)
    here = copy[on].mean(axis=0)
    is_foot = columns[0] < supports.feet
    if is_foot:
        places = supports.places[on][:, columns]  # with the sole on the floor
        here = places[lengths(places - places.mean(axis=0)).sum(axis=1).argmin()]
    if not isinstance(entry.on, str):
        here = here - here[0] + np.array(entry.on)
    elif entry.on == "floor" and not is_foot:
        floor = clip.scale.heights(np.full(len(joints), np.median(clip.source_floor[on])))
        if undersides is not None:
            floor += undersides.target.below(clip.copy, joints, clip.up)[on].mean(axis=0) - undersides.soles[1]
        here = level(here, clip.up) + np.outer(floor, clip.up)
    return np.broadcast_to(here, copy.shape)


def _carried(carrier: Carrier, copy: Array, on: Flags, thick: float) -> Array:
    """(frames, columns, 3), places that move with a carrier, the first of them `thick` above its surface."""
    assert carrier.motion is not None
    at, turns = carrier.motion.positions[:, carrier.joint], _turns_of(carrier.motion, carrier.joint)
    offsets = np.stack([turns.inv().apply(x - at)[on].mean(axis=0) for x in copy.swapaxes(0, 1)])
    surface, out = carrier.nearest(offsets[0])
    offsets += surface + (thick + carrier.radii[carrier.joint]) * out - offsets[0]
    return np.stack([at + turns.apply(offset) for offset in offsets], axis=1)


def _turns_of(motion: Motion, joint: int) -> Rotation:
    """The rotations of a joint in the world."""
    return Rotation.from_quat(motion.world_rotations_of(joint))
