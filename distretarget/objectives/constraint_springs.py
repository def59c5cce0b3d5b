"""User constraints as springs and supports: contacts, distances and planted parts, and by how much they are off.

A spring brings its joints the share s of the way from the rotation copy to what its constraint says, however stiff the
body:

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
from distretarget.skin.capsules import IS_ARM, PLACE

BETWEEN_SPAN = 0.3  # what is to be between joints is averaged over this time before and after [s]
FACING = 0.1  # and where skins face each other over this [s]
SEEN = 7  # frames that show how far skins are apart, about
LEAST_LENGTH = 1e-6  # joints that are nearer have no direction to each other [body units]


def with_constraints(
    supports: Supports,
    constraints: Constraints,
    offsets: Sequence[Array | None],
    skins: Skins | None,
    undersides: Undersides | None,
) -> Supports:
    """Return supports with those of user constraints; `skins` and `undersides` are None for bodies without thickness.

    `offsets`, (frames, 3) each [body units], are what is to be between the joints of each constraint, if that is known.
    """
    springs, clip = [supports.user_springs], constraints.clip
    for constraint, offset in zip(constraints, offsets, strict=True):
        firmness, pair = constraints.firmness(constraint), constraint.pair
        if pair is not None:
            if offset is None:
                now = between(clip.copy, pair, clip)
                offset = now + off_by(constraints, constraint, clip.copy, supports, skins)
            springs.append(_spring(clip, pair, clip.averaged(offset, BETWEEN_SPAN), firmness))
        elif isinstance(constraint.entry, Plant) and not constraint.entry.keep:
            let_go = firmness[:, None] * np.isin(supports.joints, constraint.joints[0])
            supports = replace(supports, weights=supports.weights * (1.0 - let_go))
        elif isinstance(constraint.entry, Plant):
            supports = _planted(supports, clip, constraint, firmness, undersides, skins)
    return replace(supports, user_springs=joined(*springs))


def between(motion: Motion, pair: tuple[int, int], clip: Clip) -> Array:
    """(frames, 3), the way from the second joint of a pair to the first [body units]."""
    a, b = pair
    return np.asarray((motion.positions[:, a] - motion.positions[:, b]) / clip.unit)


def off_by(
    constraints: Constraints, constraint: Constraint, motion: Motion, supports: Supports, skins: Skins | None
) -> Array:
    """Return by how much what is between the joints of a constraint, or the place of a part that is planted on the
    world, has to change in a motion, (frames, 3) [body units]; 0 for all others.
    """
    clip, entry, pair = constraints.clip, constraint.entry, constraint.pair
    if pair is None:
        columns = np.flatnonzero(np.isin(supports.joints, constraint.joints[0]) & isinstance(entry, Plant))
        if not len(columns) or not getattr(entry, "keep", False):
            return np.zeros((len(motion), 3))
        away = supports.places[:, columns] - motion.positions[:, supports.joints[columns]]
        return np.asarray(away[np.arange(len(motion)), lengths(away).argmax(axis=1)] / clip.unit)
    if constraint.anchors is not None and isinstance(entry, Contact):
        one, other, apart = constraint.anchors
        gap = constraints.length(float(entry.gap or 0.0)) + apart
        away = gap * normalised(other.normals(motion) - one.normals(motion))
        return np.asarray(away - (one.places(motion) - other.places(motion)) / clip.unit)
    now = between(motion, pair, clip)
    if isinstance(entry, Plant):
        assert constraint.carrier is not None
        return _resting_way(clip, constraint, constraint.carrier, motion, pair, skins) - now
    if isinstance(entry, Contact):
        if skins is not None and (between_skins := gap_between(constraints, constraint, skins)):
            return _to_gap(clip, constraint, motion, skins.target, *between_skins)
        if entry.gap and entry.gap != "source":
            now = _nearest_way(motion, constraint.joints) / clip.unit
    far = lengths(now)
    direction = np.where(far[:, None] > LEAST_LENGTH, normalised(now), clip.up)
    return np.asarray((_length_to_reach(constraints, entry, pair) - far)[:, None] * direction)


def _length_to_reach(constraints: Constraints, entry: Entry, pair: tuple[int, int]) -> Array | float:
    """The distance that the joints of a pair are brought to, of all frames or (frames,) [body units]."""
    if isinstance(entry, Distance):
        return constraints.length(entry.value)
    if isinstance(entry, Contact) and entry.gap != "source":
        return constraints.length(float(entry.gap or 0.0))
    clip = constraints.clip
    u, v = clip.drivers[[*pair]]
    tau, own_tau = clip.skeleton.paths_from(pair[0])[pair[1]], clip.source_skeleton.paths_from(int(u))[v]
    source = lengths(clip.source.positions[:, u] - clip.source.positions[:, v])
    return np.asarray(tau / max(own_tau, LEAST_LENGTH) / clip.unit * source)


def with_anchors_apart(constraints: Constraints, motion: Motion, body: BodySkin) -> Constraints:
    """Return constraints whose anchors are as far apart as the gaps of skin ask for, by a motion that meets them:
    the fingers of a hand touch before its palm does.
    """
    return replace(
        constraints, every=tuple(_with_anchors_apart(constraints, each, motion, body) for each in constraints)
    )


def _with_anchors_apart(constraints: Constraints, constraint: Constraint, motion: Motion, body: BodySkin) -> Constraint:
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
    return replace(constraint, anchors=constraint.anchors._replace(apart=constraint.anchors.apart + farther))


def _touching(body: BodySkin, joint: int) -> Flags:
    """(joints,), those of a part of an arm, or of all that is one place to be touched with what a joint carries."""
    own, of_joint = body.of_joint[joint], body.of_joint
    return np.asarray(of_joint == own if IS_ARM[own] else PLACE[of_joint] == PLACE[own])


def eased_gap(constraints: Constraints, constraint: Constraint, skins: Skins, motion: Motion) -> SkinGap | None:
    """Return the gap that a contact asks for, from that in a motion as it sets in, and back to it as it lets go; None
    where it asks for none between skins.
    """
    between_skins = gap_between(constraints, constraint, skins)
    if between_skins is None:
        return None
    on, gap = between_skins
    own, _ = nearest_skin(skins.target.balls, skins.target.posed(motion), on)
    return SkinGap(
        on, (1.0 - constraint.weight) * np.maximum(own, 0.0) + constraint.weight * gap, np.sqrt(constraint.weight)
    )


def gap_between(constraints: Constraints, constraint: Constraint, skins: Skins) -> tuple[Numbers, Array] | None:
    """Return the pairs of segments between which a contact asks for a gap, and the gap, (frames,) [body units]; None
    where it asks for none between skins.
    """
    entry, on = (
        constraint.entry,
        skins.target.between(*constraint.joints) if len(constraint.joints) == 2 else np.zeros(0, np.intp),
    )
    if not isinstance(entry, Contact) or constraint.anchors or not len(on):
        return None
    if entry.gap != "source":
        return on, np.full(len(constraints.clip), constraints.length(float(entry.gap or 0.0)))
    drivers = constraints.clip.drivers
    of_source = skins.source.between(*(np.setdiff1d(drivers[joints], [-1]) for joints in constraint.joints))
    gaps, _ = nearest_skin(skins.source.balls, skins.source.posed(constraints.clip.source), of_source)
    return on, np.maximum(gaps, 0.0) if len(of_source) else np.zeros(len(gaps))


def _to_gap(clip: Clip, constraint: Constraint, motion: Motion, body: BodySkin, on: Numbers, gap: Array) -> Array:
    """(frames, 3), how far the first part of a contact has to go for this gap at the pairs `on` [body units]."""
    own, away = nearest_skin(body.balls, body.posed(motion), on, body.of_joint[constraint.joints[0]])
    return np.asarray((gap - own)[:, None] * normalised(clip.averaged(away, FACING)))


def _nearest_way(motion: Motion, parts: Sequence[Numbers]) -> Array:
    """(frames, 3), the way from the second of two parts to the first between the joints that are nearest in a frame."""
    ways = motion.positions[:, parts[0], None] - motion.positions[:, None, parts[1]]
    ways = ways.reshape(len(motion), -1, 3)
    return np.asarray(ways[np.arange(len(motion)), lengths(ways).argmin(axis=1)])


def _resting_way(
    clip: Clip, constraint: Constraint, carrier: Carrier, motion: Motion, pair: tuple[int, int], skins: Skins | None
) -> Array:
    """(frames, 3), the way from a joint of the body to the part that rests on it and moves with it [body units]."""
    own = _turns_of(clip.copy, carrier.joint).inv().apply(between(clip.copy, pair, clip))
    thick = 0.0 if skins is None else sum(skins.target.thickness(joint) for joint in pair)
    offset = thick * normalised(own[constraint.frames].mean(axis=0)[None])[0]
    return np.asarray(_turns_of(motion, carrier.joint).apply(offset))


def _spring(clip: Clip, pair: tuple[int, int], way: Array, firmness: Array) -> Springs:
    """The spring that brings what is between two joints to a way, (frames, 3) [body units]."""
    A = np.zeros((len(clip), 1, 3, 3))
    on = firmness > LEAST_WEIGHT
    s = firmness[on, None, None]
    A[on, 0] = np.linalg.inv(_compliance(clip, pair, on) * (1.0 - s) / s + np.eye(3) / STIFFNESS)
    a, b = pair
    return Springs(np.array([a]), np.array([b]), way[:, None], A)


def _compliance(clip: Clip, pair: tuple[int, int], on: Flags) -> Array:
    """M: (frames, 3, 3), displacement of the first joint against the second per force, in some frames."""
    h = part_stiffness(clip)
    bones, skeleton = clip.copy.bones[on] / clip.unit, clip.skeleton
    arms = np.zeros((len(bones), len(h) - 1, 3))
    for end, sign in zip(pair, (1.0, -1.0), strict=True):
        for joint in skeleton.to_root(end):
            if joint > 0:
                arms[:, clip.parts[skeleton.parents[joint]]] += sign * bones[:, joint]
    square = ((arms**2).sum(axis=2) / h[:-1]).sum(axis=1)
    return np.asarray(square[:, None, None] * np.eye(3) - np.einsum("fpi,fpj,p->fij", arms, arms, 1.0 / h[:-1]))


# ---- parts that are planted on the world, on props and on other performers


def _planted(
    supports: Supports,
    clip: Clip,
    constraint: Constraint,
    firmness: Array,
    undersides: Undersides | None,
    skins: Skins | None,
) -> Supports:
    """The supports with a part that is planted where `firmness`, (frames,), is 1."""
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
    edge = np.clip(np.arange(len(clip)), on[0], on[-1])  # outside of its frames it moves with the copy
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
    """(frames, columns, 3), where planted joints are to be [target file units]; `copy` is where the copy's are."""
    entry, joints, on, is_foot = (
        constraint.entry,
        supports.joints[columns],
        constraint.frames,
        columns[0] < supports.feet,
    )
    assert isinstance(entry, Plant)
    if constraint.carrier is not None:
        thick = 0.0 if skins is None else skins.target.thickness(int(joints[0])) * clip.unit
        return _carried(constraint.carrier, copy, on, thick)
    here = copy[on].mean(axis=0)
    if is_foot:
        places = supports.places[on][:, columns]  # of the sole as it is on the floor
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
    """(frames, columns, 3), places that move with what they rest on, `thick` above its surface."""
    assert carrier.motion is not None
    at, turns = carrier.motion.positions[:, carrier.joint], _turns_of(carrier.motion, carrier.joint)
    ways = np.stack([turns.inv().apply(x - at)[on].mean(axis=0) for x in copy.swapaxes(0, 1)])
    surface, out = carrier.nearest(ways[0])
    ways += surface + (thick + carrier.radii[carrier.joint]) * out - ways[0]
    return np.stack([at + turns.apply(way) for way in ways], axis=1)


def _turns_of(motion: Motion, joint: int) -> Rotation:
    """The rotations of a joint in the world."""
    return Rotation.from_quat(motion.world_rotations_of(joint))
