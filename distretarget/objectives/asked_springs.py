"""The springs of contacts and distances that are asked for, and the supports of parts that are planted.

A spring brings its joints the share s of the way from the rotation copy to what is asked, however stiff the body:

    A = (M (1 - s) / s + I / k)^-1,

where M is the compliance of the body between the two joints, as in `supports`.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from distretarget.contact_entries import Contact, Distance, Plant
from distretarget.ik.springs import Springs, joined
from distretarget.matching.undersides import Undersides
from distretarget.motion import Motion
from distretarget.numerics.time_series import averaged, by_shot, largest
from distretarget.numerics.vectors import lengths, level
from distretarget.objectives.asking import Wish, Wishes
from distretarget.objectives.clip import Clip
from distretarget.objectives.contact import part_stiffness
from distretarget.objectives.skins import BodySkin, Skins
from distretarget.objectives.supports import BLEND, LEAST_WEIGHT, STIFFNESS, Supports
from distretarget.objectives.units import centimetres
from distretarget.skin.meetings import segment_gaps

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Joints = NDArray[np.intp]

FARTHEST = 2.0  # gaps of skins are found up to this [body units]
STEADY = 0.05  # what gaps are off is averaged over this time before and after [s]
LEAST_LENGTH = 1e-6  # joints that are nearer have no direction to each other [body units]


def with_wishes(supports: Supports, wishes: Wishes, skins: Skins | None, undersides: Undersides | None) -> Supports:
    """Return supports with what is asked for; `skins` and `undersides` are None for bodies without thickness."""
    springs = [supports.asked_springs]
    for wish in wishes.wishes:
        if isinstance(wish.entry, Plant):
            supports = _planted(supports, wishes, wish, undersides)
        elif isinstance(wish.entry, Distance):
            a, b = (int(joints[0]) for joints in wish.joints)
            length = np.full(len(wishes.clip), wishes.length(wish.entry.value))
            springs.append(_spring(wishes.clip, a, b, length, wish.weight))
        elif isinstance(wish.entry, Contact) and wish.entry.gap is not None:
            springs.append(_contact_spring(wishes, wish, wish.entry, skins))
    return replace(supports, asked_springs=joined(*springs))


def _contact_spring(wishes: Wishes, wish: Wish, entry: Contact, skins: Skins | None) -> Springs:
    """The spring between the joints of two parts that are nearest in the rotation copy while the contact lasts."""
    clip, (one, other) = wishes.clip, wish.joints
    a, b = _nearest(clip, one, other, wish.frames)
    apart = lengths(_between(clip.copy, a, b, clip))
    if entry.gap != "source":
        gap = np.full(len(clip), wishes.length(float(entry.gap or 0.0)))
        own = None if skins is None else _skin_gaps(skins.target, clip.copy, one, other)
        length = gap if own is None else np.maximum(apart - own + gap, 0.0)
    else:
        u, v = clip.drivers[[a, b]]
        tau, own_tau = clip.skeleton.path_lengths[a, b], clip.source_skeleton.path_lengths[u, v]
        ratio = tau / max(own_tau, LEAST_LENGTH) / clip.unit
        length = ratio * lengths(clip.source.positions[:, u] - clip.source.positions[:, v])
    spring = _spring(clip, a, b, length, entry.firmness * wish.weight)
    return spring if wish.apart is None else spring._replace(rest=wish.apart[:, None])


def nearer(wishes: Wishes, solved: Motion, bent: Motion, skins: Skins) -> Wishes:
    """Return the wishes with what is between the joints of contacts less what the gaps of their skins are off.

    A contact with the trunk is that of the motion `bent` as the skin asks, which leaves the trunk to the side; all
    others are those of the motion as it was `solved`, as skins touch afterwards.
    """
    clip, corrected = wishes.clip, []
    steady = partial(averaged, reach=max(round(STEADY / clip.frame_time), 1))
    for wish in wishes.wishes:
        entry = wish.entry
        if isinstance(entry, Contact) and isinstance(entry.gap, int | float):
            a, b = _nearest(clip, wish.joints[0], wish.joints[1], wish.frames)
            on_trunk = clip.regions.inside("hips", "trunk", "shin", "foot")[[a, b]].any()
            motion = bent if on_trunk else solved
            own, now = _skin_gaps(skins.target, motion, wish.joints[0], wish.joints[1]), _between(motion, a, b, clip)
            if own is not None:
                far = lengths(now)
                length = np.maximum(far + wishes.length(float(entry.gap)) - own, 0.0)
                better = (length / np.maximum(far, LEAST_LENGTH))[:, None] * now
                wish = replace(wish, apart=by_shot(steady, clip.shots, better))
        corrected.append(wish)
    return replace(wishes, wishes=tuple(corrected))


def how_far_off(wishes: Wishes, wish: Wish, motion: Motion, skins: Skins | None) -> Array | None:
    """Return how far a contact or distance is off what is asked in a motion, (frames,) [cm], 0 in frames of which
    nothing is asked; None for what has no distance.
    """
    clip, entry, cm = wishes.clip, wish.entry, centimetres(wishes.clip.unit) * wishes.clip.unit
    if isinstance(entry, Distance):
        a, b = (int(joints[0]) for joints in wish.joints)
        return np.asarray(wish.frames * np.abs(cm * lengths(_between(motion, a, b, clip)) - entry.value))
    if not isinstance(entry, Contact) or not isinstance(entry.gap, int | float) or entry.firmness < 1.0:
        return None
    own = None if skins is None else _skin_gaps(skins.target, motion, wish.joints[0], wish.joints[1])
    if own is None:
        own = lengths(_between(motion, *_nearest(clip, wish.joints[0], wish.joints[1], wish.frames), clip))
    return np.asarray(wish.frames * np.abs(cm * own - entry.gap))


def _nearest(clip: Clip, one: Joints, other: Joints, frames: Flags) -> tuple[int, int]:
    """The joints of two parts that are nearest to each other in the rotation copy, on average over some frames."""
    shared = np.isin(np.arange(len(clip.skeleton)), clip.distances.targets)
    a, b = (joints[shared[joints]] if shared[joints].any() else joints for joints in (one, other))
    x = clip.copy.positions[frames]
    apart = lengths(x[:, a, None] - x[:, None, b]).mean(axis=0)
    i, j = np.unravel_index(apart.argmin(), apart.shape)
    return int(a[i]), int(b[j])


def _skin_gaps(skin: BodySkin, motion: Motion, one: Joints, other: Joints) -> Array | None:
    """(frames,), the gap between the skins of two parts in a motion [body units]; None if it is not known."""
    on = skin.between(one, other)
    if not len(on):
        return None
    return np.asarray(segment_gaps(skin.balls, skin.posed(motion), FARTHEST)[:, on].min(axis=1))


def _between(motion: Motion, a: int, b: int, clip: Clip) -> Array:
    """(frames, 3), the way from joint b to joint a in a motion of the target [body units]."""
    return np.asarray((motion.positions[:, a] - motion.positions[:, b]) / clip.unit)


def _spring(clip: Clip, a: int, b: int, length: Array, weight: Array) -> Springs:
    """The spring that brings joint a to a distance from b, (frames,) [body units], in the direction of the copy."""
    apart = _between(clip.copy, a, b, clip)
    far = lengths(apart)[:, None]
    direction = np.where(far > LEAST_LENGTH, apart / np.maximum(far, LEAST_LENGTH), clip.up)
    A = np.zeros((len(clip), 1, 3, 3))
    on = weight > LEAST_WEIGHT
    if on.any():
        s = weight[on, None, None]
        A[on, 0] = np.linalg.inv(_compliance(clip, a, b, on) * (1.0 - s) / s + np.eye(3) / STIFFNESS)
    return Springs(np.array([a]), np.array([b]), (length[:, None] * direction)[:, None], A)


def _compliance(clip: Clip, a: int, b: int, on: Flags) -> Array:
    """M: (frames, 3, 3), displacement of joint a against joint b per force, in some frames."""
    h = part_stiffness(clip)
    bones, skeleton = clip.bones[on] / clip.unit, clip.skeleton
    arms = np.zeros((len(bones), len(h) - 1, 3))
    for end, sign in ((a, 1.0), (b, -1.0)):
        for joint in skeleton.line(end):
            if joint > 0:
                arms[:, clip.parts[skeleton.parents[joint]]] += sign * bones[:, joint]
    square = (arms**2).sum(axis=2) / h[:-1]
    return np.asarray(
        square.sum(axis=1)[:, None, None] * np.eye(3) - np.einsum("fpi,fpj,p->fij", arms, arms, 1.0 / h[:-1])
    )


def _planted(supports: Supports, wishes: Wishes, wish: Wish, undersides: Undersides | None) -> Supports:
    """The supports with a part that is planted, or let go."""
    clip, entry = wishes.clip, wish.entry
    assert isinstance(entry, Plant)
    columns = np.flatnonzero(np.isin(supports.joints, wish.joints[0]))
    if not entry.keep:
        weights = np.array(supports.weights)
        weights[:, columns] *= 1.0 - _let_go(clip, wish.frames)[:, None]
        return replace(supports, weights=weights)
    foot = columns[columns < supports.feet]
    if not len(foot):
        joint = int(wish.joints[0][0])
        columns = np.flatnonzero(supports.joints == joint)
        if not len(columns):
            supports, columns = _with_joint(supports, clip, joint), np.array([len(supports.joints)])
    else:
        columns = foot
    weights, places = np.array(supports.weights), np.array(supports.places)
    w = wish.weight[:, None]
    goal = _goal(supports, clip, wish, entry, columns, undersides, is_foot=bool(len(foot)))
    places[:, columns] += w[..., None] * (goal - places[:, columns])
    weights[:, columns] = np.maximum(weights[:, columns], w)
    return replace(supports, weights=weights, places=places)


def _goal(
    supports: Supports,
    clip: Clip,
    wish: Wish,
    entry: Plant,
    columns: Joints,
    undersides: Undersides | None,
    *,
    is_foot: bool,
) -> Array:
    """(columns, 3), where planted joints are to be [target file units]."""
    joints = supports.joints[columns]
    here = clip.copy_on_path(joints)[wish.frames].mean(axis=0)
    if is_foot:
        places = supports.places[wish.frames][:, columns]  # of the sole as it is on the floor
        here = places[lengths(places - places.mean(axis=0)).sum(axis=1).argmin()]
    if entry.on == "where it is" or (is_foot and entry.on == "floor"):
        return np.asarray(here)
    if entry.on == "floor":
        floor = np.full(len(joints), clip.scale.height * np.median(clip.source_floor[wish.frames]))
        if undersides is not None:
            below = undersides.target.below(clip.copy, joints, clip.up)[wish.frames].mean(axis=0)
            floor += below - undersides.soles[1]
        return np.asarray(level(here, clip.up) + np.outer(floor, clip.up))
    return np.asarray(here - here[0] + np.array(entry.on))


def _with_joint(supports: Supports, clip: Clip, joint: int) -> Supports:
    """The supports with one more joint, which rests nowhere."""
    return replace(
        supports,
        joints=np.append(supports.joints, joint),
        regions=np.append(supports.regions, clip.regions.of_joint[joint]),
        weights=np.concatenate([supports.weights, np.zeros((len(clip), 1))], axis=1),
        places=np.concatenate([supports.places, clip.copy_on_path(np.array([joint]))], axis=1),
    )


def _let_go(clip: Clip, frames: Flags) -> Array:
    """(frames,), 1 in some frames and while a joint blends to or from its place around them, then blended to 0."""
    blend = round(BLEND / clip.frame_time)

    def around(values: Array) -> Array:
        return averaged(largest(values, 3 * blend + 1), blend) if blend else values

    return by_shot(around, clip.shots, frames[:, None].astype(float))[:, 0]
