"""Which source joint drives which target joint: by an explicit map, equal names, the parts of the body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from distretarget.body.body import Body
from distretarget.body.legs import Leg, Legs, leg_length
from distretarget.errors import MatchingError, MotionError
from distretarget.matching.pairing import JointMap, find_pairs, pairs_of_map, tips
from distretarget.matching.spine import spine_blend
from distretarget.motion import Motion

ENOUGH = 0.5  # part of the target's joints that need the names of source joints, where no human body is recognised
LANDMARKS = ("hips", "head", "leftHand", "rightHand", "leftFoot", "rightFoot")
CONFIDENCE = {"map": 1.0, "name": 1.0, "names": 0.95, "shape": 0.8, "tip": 0.9, "": 0.0}  # by method, 0 to 1
LIMBS = ("leftUpperArm", "rightUpperArm", "leftUpperLeg", "rightUpperLeg")  # two bodies must share one of these


@dataclass(frozen=True, eq=False)
class Matching:
    """Which source joint drives which target joint, and how that was found.

    Attributes:
        source, target: the bodies, with left and right as their bodies show them where both do.
        drivers: (target joints,), the source joint that stands in each target joint's place; -1 for none.
        rotation_sources: (target joints, 2), the source joints whose rotations each target joint follows, the same
            twice where it is one; -1 where it follows its parent. In a spine or neck of another number of joints they
            are neighbours.
        blend: (target joints,), the share of the second rotation source, 0 to 1.
        method: per target joint "map", "name" (equal names), "names" (names of the parts of a body), "shape", "tip"
            (what ends a matched joint), or "" where it has no driver.
    """

    source: Body
    target: Body
    drivers: NDArray[np.intp]
    rotation_sources: NDArray[np.intp]
    blend: NDArray[np.float64]
    method: tuple[str, ...]

    def __repr__(self) -> str:
        joints = self.target.skeleton.joints
        matched = sum(self.drivers[joint] >= 0 for joint in joints)
        return f"<Matching of {matched} of the target's {len(joints)} joints>"

    @property
    def source_motion(self) -> Motion:
        """The motion of the source.

        Raises:
            MotionError: it has none.
        """
        if self.source.motion is None:
            raise MotionError("the source has no frames; there is nothing to retarget")
        return self.source.motion

    @property
    def confidence(self) -> NDArray[np.float64]:
        """(target joints,), 0 to 1, how far to trust each pair: by how it was found, times how alike the places of the
        two joints are between hips, head, hands and feet, in path lengths.
        """
        by_method = np.array([CONFIDENCE[method] for method in self.method])
        bodies = [body for body in (self.source, self.target) if body.anatomy]
        marks = [mark for mark in LANDMARKS if all(body.anatomy and mark in body.anatomy.roles for body in bodies)]
        if len(bodies) < 2 or not marks:
            return by_method
        places = []
        for body in bodies:
            joints = [body.anatomy.roles[mark] for mark in marks] if body.anatomy else []
            tau = body.skeleton.path_lengths[:, joints]
            places.append(tau / (tau[joints].max() or 1.0))
        unlike = np.abs(places[0][self.drivers] - places[1]).mean(axis=1)
        return np.asarray(by_method * np.clip(1.0 - unlike, 0.0, 1.0))

    @property
    def without_driver(self) -> list[str]:
        """The target's joints, by key, that follow no joint of the source; End Sites apart."""
        alone = (self.rotation_sources[:, 0] < 0) & (self.drivers < 0)
        return [self.target.skeleton.keys[joint] for joint in self.target.skeleton.joints if alone[joint]]

    @property
    def followers(self) -> list[str]:
        """Those of them that follow their parents, which the root has not."""
        return [key for key in self.without_driver if key != self.target.skeleton.keys[0]]

    @cached_property
    def legs(self) -> tuple[Legs, Legs] | None:
        """The legs of the source and those of the target, joint by joint: the target's own legs, and the source joints
        that drive them. None unless hips and ankles are driven and the source's legs have a length.

        What ends a foot is the toe if it has a driver; else the ankle stands for it.
        """
        if self.target.legs is None:
            return None
        left, right = (leg if self.drivers[leg.toe] >= 0 else replace(leg, toe=leg.ankle) for leg in self.target.legs)
        a, b = (Leg(*(int(self.drivers[joint]) for joint in leg.joints)) for leg in (left, right))
        driven = min(*a.joints, *b.joints) >= 0
        return ((a, b), (left, right)) if driven and leg_length(self.source.skeleton, (a, b)) > 0 else None

    @cached_property
    def pelvis(self) -> int:
        """The target joint from which its legs part, if it has a driver; else the first that has."""
        first = int(np.argmax(self.drivers >= 0))
        joint = self.target.pelvis_joint if self.legs else None
        return first if joint is None or self.drivers[joint] < 0 else joint


def match(source: Body, target: Body, joint_map: JointMap | None = None) -> Matching:
    """The matching of `find_matching`, if a motion can be retargeted by it.

    Raises:
        MatchingError: it cannot; the message has the names of both and the closest ones.
        MapError: `joint_map` names joints that are not there.
    """
    matching = find_matching(source, target, joint_map)
    if reason := refusal(matching):
        source_keys, target_keys = ([body.skeleton.keys[j] for j in body.skeleton.joints] for body in (source, target))
        raise MatchingError(reason, source_keys, target_keys)
    return matching


def find_matching(source: Body, target: Body, joint_map: JointMap | None = None) -> Matching:
    """Match the joints of two bodies, as far as that goes.

    `joint_map` has a source key for target keys, None for joints that nothing shall drive; the other joints are matched
    by names or by shape.

    Raises:
        MapError: `joint_map` names joints that are not there.
    """
    source, target, crossed = _sided(source, target)
    found = find_pairs(source, target, crossed)
    wanted = pairs_of_map(source.skeleton, target.skeleton, joint_map or {})
    pairs = found | wanted
    pairs |= tips(source.skeleton, target.skeleton, pairs)
    joints = range(len(target.skeleton))
    drivers = np.array([pairs.get(joint, (-1, ""))[0] for joint in joints], np.intp)
    method = tuple(pairs[joint][1] if drivers[joint] >= 0 else "" for joint in joints)
    rotation_sources, blend = np.stack([drivers, drivers], axis=1), np.zeros(len(drivers))
    overruled = {joint for joint in wanted if wanted[joint][0] != found.get(joint, (None, ""))[0]}
    for joint, neighbours, share in spine_blend(source, target):
        if joint not in overruled:
            rotation_sources[joint], blend[joint] = neighbours, share
    return Matching(source, target, drivers, rotation_sources, blend, method)


def refusal(matching: Matching) -> str:
    """Why a motion cannot be retargeted by this matching; empty where it can."""
    joints = matching.target.skeleton.joints
    named = sum(matching.method[joint] in ("name", "map") for joint in joints)
    if named >= ENOUGH * len(joints) or "map" in matching.method:
        return ""
    s, t = matching.source.anatomy, matching.target.anatomy
    if not (s and t):
        body = "the source" if t else "the target" if s else "either of them"
        return (
            f"only {named} of {len(joints)} joints of the target have a driver by name, and no human body is "
            f"recognised in {body}"
        )
    for name, side in (("source", matching.source), ("target", matching.target)):
        if side.on_all_fours:
            return f"the {name} seems to go on all fours: its trunk lies across its legs"
    if not any(role in s.roles and role in t.roles for role in LIMBS):
        return "they share neither arms nor legs"
    return "" if (matching.drivers >= 0).any() else "no joint of the target has a driver"


def _sided(source: Body, target: Body) -> tuple[Body, Body, bool]:
    """Both bodies, with left on the body's left as far as that is known of both, and whether the names of one say left
    for right and those of the other do not.
    """
    if source.left_is_left is None or target.left_is_left is None:
        return source, target, False
    s, t = (body if body.left_is_left else body.mirrored for body in (source, target))
    return s, t, source.left_is_left != target.left_is_left
