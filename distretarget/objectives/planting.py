"""Parts that a user plants on the world, on props and on other performers, and parts that are let go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.contact_entries import Plant
from distretarget.matching.undersides import Undersides
from distretarget.motion import Motion
from distretarget.numerics.vectors import lengths, level
from distretarget.objectives.asking import Carrier, Wish
from distretarget.objectives.clip import Clip
from distretarget.objectives.skins import Skins
from distretarget.objectives.supports import Supports

Array = NDArray[np.float64]
Joints = NDArray[np.intp]


def let_go(supports: Supports, joints: Joints, firmness: Array) -> Supports:
    """Return the supports without those at some joints, where `firmness`, (frames,), is 1."""
    at = np.isin(supports.joints, joints)
    return replace(supports, weights=np.where(at, supports.weights * (1.0 - firmness[:, None]), supports.weights))


def planted(
    supports: Supports, clip: Clip, wish: Wish, firmness: Array, undersides: Undersides | None, skins: Skins | None
) -> Supports:
    """Return the supports with a part that is planted where `firmness`, (frames,), is 1."""
    columns = np.flatnonzero(np.isin(supports.joints[: supports.feet], wish.joints[0]))
    is_foot = len(columns) > 0
    if not is_foot:
        joint = int(wish.joints[0][0])
        if joint not in supports.joints:
            supports = _with_joint(supports, clip, joint)
        columns = np.flatnonzero(supports.joints == joint)
    joints, on = supports.joints[columns], np.flatnonzero(wish.frames)
    copy = clip.copy_on_path(joints)
    goal = _goal(supports, clip, wish, columns, copy, undersides, skins, is_foot=is_foot)
    edge = np.clip(np.arange(len(clip)), on[0], on[-1])  # outside of its frames it moves with the copy
    goal = copy + (goal - copy)[edge]
    weights, places, w = np.array(supports.weights), np.array(supports.places), firmness[:, None]
    places[:, columns] += w[..., None] * (goal - places[:, columns])
    weights[:, columns] = np.maximum(weights[:, columns], w)
    return replace(supports, weights=weights, places=places)


def _goal(
    supports: Supports,
    clip: Clip,
    wish: Wish,
    columns: Joints,
    copy: Array,
    undersides: Undersides | None,
    skins: Skins | None,
    *,
    is_foot: bool,
) -> Array:
    """(frames, columns, 3), where planted joints are to be [target file units]; `copy` is where the copy's are."""
    entry, joints, on = wish.entry, supports.joints[columns], wish.frames
    assert isinstance(entry, Plant)
    if wish.carrier is not None:
        thick = 0.0 if skins is None else skins.target.thickness(int(joints[0])) * clip.unit
        return _carried(wish.carrier, copy, on, thick)
    here = copy[on].mean(axis=0)
    if is_foot:
        places = supports.places[on][:, columns]  # of the sole as it is on the floor
        here = places[lengths(places - places.mean(axis=0)).sum(axis=1).argmin()]
    if not isinstance(entry.on, str):
        here = here - here[0] + np.array(entry.on)
    elif entry.on == "floor" and not is_foot:
        floor = np.full(len(joints), clip.scale.height * np.median(clip.source_floor[on]))
        if undersides is not None:
            floor += undersides.target.below(clip.copy, joints, clip.up)[on].mean(axis=0) - undersides.soles[1]
        here = level(here, clip.up) + np.outer(floor, clip.up)
    return np.broadcast_to(here, copy.shape)


def _carried(carrier: Carrier, copy: Array, on: NDArray[np.bool_], thick: float) -> Array:
    """(frames, columns, 3), places that move with what they rest on, `thick` above its surface."""
    assert carrier.motion is not None
    at, turns = carrier.motion.positions[:, carrier.joint], turns_of(carrier.motion, carrier.joint)
    ways = np.stack([turns.inv().apply(x - at)[on].mean(axis=0) for x in copy.swapaxes(0, 1)])
    surface, out = carrier.nearest(ways[0])
    ways += surface + (thick + carrier.radii[carrier.joint]) * out - ways[0]
    return np.stack([at + turns.apply(way) for way in ways], axis=1)


def turns_of(motion: Motion, joint: int) -> Rotation:
    """The rotations of a joint in the world."""
    return Rotation.from_quat(motion.world_rotations_of(joint))


def _with_joint(supports: Supports, clip: Clip, joint: int) -> Supports:
    """The supports with one more joint, which rests nowhere."""
    return replace(
        supports,
        joints=np.append(supports.joints, joint),
        regions=np.append(supports.regions, clip.regions.of_joint[joint]),
        weights=np.concatenate([supports.weights, np.zeros((len(clip), 1))], axis=1),
        places=np.concatenate([supports.places, clip.copy_on_path(np.array([joint]))], axis=1),
    )
