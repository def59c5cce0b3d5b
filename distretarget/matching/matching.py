"""Which source joint drives which target joint: by an explicit map, equal names, the parts of the body."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import SIDES, Anatomy
from distretarget.body.axes import on_all_fours, sides_agree, toe_bone
from distretarget.body.conventions import by_names
from distretarget.body.legs import Leg, find_legs, leg_length, parting
from distretarget.body.shape import by_shape
from distretarget.errors import MatchingError
from distretarget.matching.pairing import JointMap, find_pairs, given, joints_of, tips
from distretarget.matching.spine import spread
from distretarget.skeleton import Skeleton

ENOUGH = 0.5  # of the target's joints must have the names of source joints, where no human body is recognised
LANDMARKS = ("hips", "head", "leftHand", "rightHand", "leftFoot", "rightFoot")
TRUST = {"map": 1.0, "name": 1.0, "names": 0.95, "shape": 0.8, "tip": 0.9, "": 0.0}
LIMBS = ("leftUpperArm", "rightUpperArm", "leftUpperLeg", "rightUpperLeg")  # of which bodies must share one

Positions = NDArray[np.float64] | None
Anatomies = tuple[Anatomy | None, Anatomy | None]


@dataclass(frozen=True, eq=False)
class Matching:
    """Which source joint drives which target joint, and how that was found.

    Attributes:
        source, target: the skeletons.
        drivers: (target joints,), the source joint that stands in each target joint's place; -1 for none.
        turns: (target joints, 2), the source joints whose rotations each target joint follows, the same twice where it
            is one; -1 where it follows its parent. In a spine or neck of another number of joints they are neighbours.
        shares: (target joints,), the share of the second of them.
        found: per target joint "map", "name" (equal names), "names" (names of the parts of a body), "shape", "tip"
            (what ends a matched joint), or "" where it has no driver.
        anatomies: of source and target; None where no human body is recognised.
    """

    source: Skeleton
    target: Skeleton
    drivers: NDArray[np.intp]
    turns: NDArray[np.intp]
    shares: NDArray[np.float64]
    found: tuple[str, ...]
    anatomies: Anatomies

    @property
    def sure(self) -> NDArray[np.float64]:
        """(target joints,), 0 to 1, how far to trust each pair: by how it was found, times how alike the places of the
        two joints are between hips, head, hands and feet, in path lengths.
        """
        trust = np.array([TRUST[found] for found in self.found])
        s, t = self.anatomies
        marks = [mark for mark in LANDMARKS if s and t and mark in s.roles and mark in t.roles]
        if not (s and t and marks):
            return trust
        places = []
        for body, anatomy in ((self.source, s), (self.target, t)):
            joints = [anatomy.roles[mark] for mark in marks]
            tau = body.path_lengths[:, joints]
            places.append(tau / (tau[joints].max() or 1.0))
        unlike = np.abs(places[0][self.drivers] - places[1]).mean(axis=1)
        return np.asarray(trust * np.clip(1.0 - unlike, 0.0, 1.0))

    @property
    def without_driver(self) -> list[str]:
        """The target's joints, by key, that follow no joint of the source; End Sites apart."""
        alone = (self.turns[:, 0] < 0) & (self.drivers < 0)
        return [self.target.keys[joint] for joint in joints_of(self.target) if alone[joint]]

    @property
    def followers(self) -> list[str]:
        """Those of them that follow their parents, which the root has not."""
        return [key for key in self.without_driver if key != self.target.keys[0]]

    @cached_property
    def legs(self) -> tuple[tuple[Leg, Leg], tuple[Leg, Leg]] | None:
        """The legs of the target and those of the source, joint by joint; None without legs that both have.

        They are the legs of the two bodies; where none is recognised, those that the target's tree shows.
        """
        legs = find_legs(self.target) if None in self.anatomies else self._named_legs()
        if legs is None:
            return None
        a, b = (Leg(*(int(self.drivers[joint]) for joint in (leg.hip, leg.ankle, leg.toe))) for leg in legs)
        driven = min(a.hip, a.ankle, a.toe, b.hip, b.ankle, b.toe) >= 0
        return (legs, (a, b)) if driven and leg_length(self.source, (a, b)) > 0 else None

    def _named_legs(self) -> tuple[Leg, Leg] | None:
        """The target's legs by the parts of its body; what ends the foot is the toe, if it has a driver."""
        anatomy = self.anatomies[1]
        ends = {side + part for side in SIDES for part in ("UpperLeg", "Foot")}
        if anatomy is None or not ends <= anatomy.roles.keys():
            return None
        a, b = (Leg(anatomy.roles[f"{side}UpperLeg"], *self._foot(anatomy, side)) for side in SIDES)
        return a, b

    def _foot(self, anatomy: Anatomy, side: str) -> tuple[int, int]:
        """The target's ankle and toe of a side; the ankle twice where no toe has a driver."""
        foot = toe_bone(self.target, anatomy, side)
        ankle = anatomy.roles[f"{side}Foot"]
        return (ankle, foot[1]) if foot and self.drivers[foot[1]] >= 0 else (ankle, ankle)

    @cached_property
    def pelvis(self) -> int:
        """The target joint from which its legs part, if it has a driver; else the first that has."""
        first = int(np.argmax(self.drivers >= 0))
        joint = parting(self.target, self.legs[0]) if self.legs else first
        return joint if self.drivers[joint] >= 0 else first


def match(
    source: Skeleton,
    target: Skeleton,
    explicit: JointMap | None = None,
    positions: Positions = None,
    target_positions: Positions = None,
) -> Matching:
    """The matching of `find_matching`, if it is one that a motion can be carried over by.

    Raises:
        MatchingError: it is not; the message has the names of both and the closest ones.
        MapError: `explicit` names joints that are not there.
    """
    matching = find_matching(source, target, explicit, positions, target_positions)
    if reason := refusal(matching, positions, target_positions):
        raise MatchingError(reason, *([body.keys[j] for j in joints_of(body)] for body in (target, source)))
    return matching


def find_matching(
    source: Skeleton,
    target: Skeleton,
    explicit: JointMap | None = None,
    positions: Positions = None,
    target_positions: Positions = None,
) -> Matching:
    """Match the joints of two skeletons, as far as that goes.

    Pairs of `explicit` count before all, {target key: source key, or None for no driver}. If every joint of the target
    has the name of a source joint, names decide. Otherwise the parts of the body, known by names or by shape, and then
    equal names for joints that are left; equal names first where both follow one convention, and alone where there is
    no human body. Left and right are those of the bodies, whatever the joints are called.

    `positions` and `target_positions`, (frames, joints, 3), are those of source and target in motion: they tell a shape
    where its rest pose does not.

    Raises:
        MapError: `explicit` names joints that are not there.
    """
    (s, t), crossed = _sided(source, target, positions, target_positions)
    found_pairs = find_pairs(source, target, (s, t), crossed)
    wanted = given(source, target, explicit or {})
    pairs = found_pairs | wanted
    pairs |= tips(source, target, pairs)
    drivers = np.array([pairs.get(joint, (-1, ""))[0] for joint in range(len(target))], np.intp)
    found = tuple(pairs[joint][1] if drivers[joint] >= 0 else "" for joint in range(len(target)))
    turns, shares = np.stack([drivers, drivers], axis=1), np.zeros(len(target))
    if s and t:
        kept = {joint for joint in wanted if wanted[joint][0] != found_pairs.get(joint, (None, ""))[0]}
        spread((source, s), (target, t), kept, turns, shares)
    return Matching(source, target, drivers, turns, shares, found, (s, t))


def refusal(matching: Matching, positions: Positions = None, target_positions: Positions = None) -> str:
    """Why a motion cannot be carried over by this matching; empty where it can. Positions as in `find_matching`."""
    joints = joints_of(matching.target)
    named = sum(matching.found[joint] in ("name", "map") for joint in joints)
    s, t = matching.anatomies
    if named >= ENOUGH * len(joints) or "map" in matching.found:
        return ""
    if not (s and t):
        body = "the source" if t else "the target" if s else "either of them"
        return (
            f"only {named} of {len(joints)} joints of the target have a driver by name, and no human body is "
            f"recognised in {body}"
        )
    for what, skeleton, anatomy, x in (
        ("source", matching.source, s, positions),
        ("target", matching.target, t, target_positions),
    ):
        if on_all_fours(skeleton, anatomy, x):
            return f"the {what} seems to go on all fours: its trunk lies across its legs"
    if not any(role in s.roles and role in t.roles for role in LIMBS):
        return "they share neither arms nor legs"
    return "" if (matching.drivers >= 0).any() else "no joint of the target has a driver"


def _sided(source: Skeleton, target: Skeleton, theirs: Positions, ours: Positions) -> tuple[Anatomies, bool]:
    """The anatomies of both, left being the body's left as far as that is known of both, and whether the names of one
    say left for right and those of the other do not.
    """
    s, t = _anatomy(source, theirs), _anatomy(target, ours)
    if s is None or t is None:
        return (s, t), False
    left_is_left = sides_agree(source, s, theirs), sides_agree(target, t, ours)
    if None in left_is_left:
        return (s, t), False
    s, t = (body if named else body.mirrored for body, named in zip((s, t), left_is_left, strict=True))
    return (s, t), left_is_left[0] != left_is_left[1]


def _anatomy(skeleton: Skeleton, positions: Positions) -> Anatomy | None:
    return by_names(skeleton) or by_shape(skeleton, positions)
