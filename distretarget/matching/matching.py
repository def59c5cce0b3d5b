"""Which source joint drives which target joint: by a joint map, equal names, or body parts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, wraps
from types import NoneType
from typing import TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from distretarget.body.anatomy import Regions
from distretarget.body.body import Body, Pose
from distretarget.body.limbs import Leg, Legs, leg_length
from distretarget.body.soles import (
    Normals,
    Sole,
    find_soles,
    flat_normals,
    leg_angles,
    resting_normals,
    untilted_normals,
    with_normals,
    with_resting_feet,
)
from distretarget.checks import check_kind
from distretarget.errors import MatchingError, MotionError
from distretarget.matching.pairing import find_pairs, pairs_of_map, spine_blend, with_tips
from distretarget.motion import Motion
from distretarget.numerics.time_series import smoothstep
from distretarget.numerics.vectors import Array, Flags, Numbers, normalised, read_only
from distretarget.rig import CACHED_RIGS, rig_cached, rig_property
from distretarget.skeleton import JointMap, same_up_to_scale
from distretarget.skin.mesh import SkinnedMesh

Found = TypeVar("Found")

BUILD_ANGLE = np.radians(55)  # bones whose rest directions differ by less differ in build, not in pose [rad]
FEET_BUILD = np.radians(7)  # feet that turn out farther than this, in full from twice this on, are posed so [rad]
NAMED_SHARE = 0.5  # least share of target joints matched by name if no human body is recognised [0 to 1]
LANDMARKS = ("hips", "head", "leftHand", "rightHand", "leftFoot", "rightFoot")  # path lengths to them are compared
CONFIDENCE = {"map": 1.0, "name": 1.0, "names": 0.95, "shape": 0.8, "tip": 0.9, "": 0.0}  # by method [0 to 1]
LIMB_ROLES = ("leftUpperArm", "rightUpperArm", "leftUpperLeg", "rightUpperLeg")  # two bodies must share one of these


@dataclass(frozen=True, eq=False, kw_only=True)
class Matching:
    """Which source joint drives which target joint, and how each pair was found.

    Attributes:
        source, target: the bodies; if the feet of both show the left side, the feet decide which side is left, not
            the names.
        drivers: (target joints,), the source joint that drives each target joint; -1 for none.
        rotation_sources: (target joints, 2), the source joints whose rotations each target joint blends: its driver
            twice, or two neighbours in a spine or neck with another number of joints; -1 to follow the parent.
        blend: (target joints,), the weight of the second rotation source [0 to 1].
        method: how each target joint was matched: "map", "name" (equal names), "names" (body parts by name or as the
            file's humanoid states), "shape" (body parts by shape), "tip" (child of a matched joint), or "" without a
            driver.
        source_normals, target_normals: the normals of the left and right sole, (3,) each, in the axes of the ankles,
            if they replace those that the poses show.
    """

    source: Body
    target: Body
    drivers: Numbers
    rotation_sources: Numbers
    blend: Array
    method: tuple[str, ...]
    source_normals: Normals | None = None
    target_normals: Normals | None = None

    def __repr__(self) -> str:
        joints = self.target.skeleton.joints
        matched = sum(self.drivers[joint] >= 0 for joint in joints)
        return f"<Matching of {matched} of the target's {len(joints)} joints>"

    @cached_property
    def rig(self) -> Matching | None:
        """The matching without motions and soles' normals, one for all clips; None if rest poses do not stand."""
        source, target = self.source.rig, self.target.rig
        if source is None or target is None:
            return None
        arrays = (each.tobytes() for each in (self.drivers, self.rotation_sources, self.blend))
        return _rig(source, target, *arrays, self.method)

    @property
    def source_motion(self) -> Motion:
        """The motion of the source; a MotionError if it has none."""
        if self.source.motion is None:
            raise MotionError("the source has no frames; expected one or more")
        return self.source.motion

    @property
    def confidence(self) -> Array:
        """(target joints,), the confidence of the method, times the similarity of paths to hips, head, hands, feet."""
        by_method = np.array([CONFIDENCE[method] for method in self.method])
        roles = [body.roles for body in (self.source, self.target)]
        marks = [mark for mark in LANDMARKS if mark in roles[0] and mark in roles[1]]
        if not marks:
            return by_method
        distances = []  # from all joints to the landmarks, relative to the largest between landmarks
        for body, own in zip((self.source, self.target), roles, strict=True):
            joints = [own[mark] for mark in marks]
            tau = np.stack([body.skeleton.paths_from(joint) for joint in joints], axis=1)
            distances.append(tau / (tau[joints].max() or 1.0))
        difference = np.abs(distances[0][self.drivers] - distances[1]).mean(axis=1)
        return np.asarray(by_method * np.clip(1.0 - difference, 0.0, 1.0))

    @property
    def without_driver(self) -> list[str]:
        """The keys of the target joints, except End Sites, that no source joint drives."""
        skeleton, undriven = self.target.skeleton, (self.rotation_sources[:, 0] < 0) & (self.drivers < 0)
        return [skeleton.keys[joint] for joint in skeleton.joints if undriven[joint]]

    @property
    def followers(self) -> list[str]:
        """The keys of the joints that follow their parents: those without driver, except the root and IK handles."""
        others = {self.target.skeleton.keys[joint] for joint in (0, *self.target.handles)}
        return [key for key in self.without_driver if key not in others]

    @rig_property
    def legs(self) -> tuple[Legs, Legs] | None:
        """The source joints that drive the target's legs, and these legs; None unless all have drivers and a length."""
        if self.target.legs is None:
            return None
        left, right = (leg if self.drivers[leg.toe] >= 0 else replace(leg, toe=leg.ankle) for leg in self.target.legs)
        a, b = (Leg(*(int(self.drivers[joint]) for joint in leg.joints)) for leg in (left, right))
        driven = min(*a.joints, *b.joints) >= 0
        return ((a, b), (left, right)) if driven and leg_length(self.source.skeleton, (a, b)) > 0 else None

    @rig_property
    def leg_lengths(self) -> tuple[float, float]:
        """The lengths of these legs, thigh plus shin, in source and target [file units of each]; 0 without legs."""
        return (leg_length(self.source.skeleton, self.legs[0]), self.target.leg_length) if self.legs else (0.0, 0.0)

    @rig_property
    def regions(self) -> Regions:
        """The regions of the target; joints that a map drives belong to the region they are attached to."""
        mapped = [joint for joint, method in enumerate(self.method) if method == "map"]
        return self.target.regions.with_joints(self.target.skeleton, mapped)

    @rig_property
    def body_joints(self) -> Numbers:
        """The joints of the target's body that have drivers."""
        return np.flatnonzero((self.drivers >= 0) & (self.regions.of_joint >= 0))

    def joints_but_feet(self, *, driven: bool = True) -> Numbers:
        """Return the joints of the target's body except the feet, with or without driver; none without legs."""
        return np.flatnonzero(((self.drivers >= 0) == driven) & self._but_feet)

    @rig_property
    def _but_feet(self) -> Flags:
        """(joints,), the joints of the target's body except the feet; none without legs."""
        of_joint = self.regions.of_joint
        feet = [of_joint[leg.ankle] for leg in self.legs[1]] if self.legs else []
        return np.asarray((of_joint >= 0) & ~np.isin(of_joint, feet) & bool(feet))

    @rig_property
    def rest_poses_alike(self) -> bool:
        """Whether every bone has about the same direction in both rest poses."""
        _, a, b = self.shared_bones(self.source.skeleton.rest_positions, self.target.skeleton.rest_positions)
        return bool(((a * b).sum(axis=1) >= np.cos(BUILD_ANGLE)).all())

    @rig_property
    def is_same_rig(self) -> bool:
        """Whether drivers have the parents and, up to scale, the rest positions of the joints that they drive."""
        source, target = self.source.skeleton, self.target.skeleton
        driven = np.flatnonzero(self.drivers >= 0)
        drivers, above = self.drivers[driven], target.parents[driven]
        parents = np.where(above >= 0, self.drivers[above], -1)
        if len(np.unique(drivers)) < len(drivers) or not np.array_equal(source.parents[drivers], parents):
            return False
        below = np.intersect1d(driven, [*target.subtree(self.pelvis)])
        own = target.rest_positions[below] - target.rest_positions[self.pelvis]
        places = source.rest_positions[self.drivers[below]] - source.rest_positions[self.drivers[self.pelvis]]
        return same_up_to_scale(places, own)

    @rig_property
    def in_reference(self) -> bool:
        """Whether bodies are aligned in reference poses, not rest poses: if both stand, or rest poses differ."""
        recognised = self.source.anatomy is not None and self.target.anatomy is not None
        both_stand = self.source.stands and self.target.stands
        return recognised and (both_stand or self.source.standing is not None or not self.rest_poses_alike)

    @cached_property
    def poses(self) -> tuple[Pose, Pose]:
        """The poses in which source and target are aligned."""
        source, target = self.source, self.target
        pose, own = (source.reference, target.reference) if self.in_reference else (source.rest, target.rest)
        if self.legs and self._only_source_feet_bend:
            pose = with_resting_feet(pose, source, self.legs[0])
        return pose, own

    @rig_property
    def _only_source_feet_bend(self) -> bool:
        """Whether only the source's feet bend between ankle and toe; their rest pose does not show them flat."""
        bodies = self.source, self.target
        return [any(leg.foot_bends(body.skeleton) for leg in body.legs or ()) for body in bodies] == [True, False]

    def shared_bones(self, x: Array, y: Array) -> tuple[Numbers, Array, Array]:
        """Return the bones of both bodies, the target joint at the upper end of each, (bones,), and unit directions on
        both, (bones, 3), for joint positions. They join driven joints to the nearest above, without those of length 0,
        and of joints that are not part of the body.
        """
        driven = (self.drivers >= 0) & ~np.isin(self.drivers, self.source.above_hips)
        driven[[*self.target.above_hips]] = False
        nearest: list[int] = []  # the nearest driven ancestor of each joint
        for parent in self.target.skeleton.parents.tolist():
            nearest.append(parent if parent < 0 or driven[parent] else nearest[parent])
        above = np.array(nearest)
        lower = np.flatnonzero(driven & (above >= 0))
        lower = lower[np.argsort(above[lower], kind="stable")]
        of_body = np.minimum(self.regions.of_joint, self.source.regions.of_joint[self.drivers]) >= 0
        lower = lower[of_body[lower] | ~of_body[above[lower]]]
        upper = above[lower]
        a, b = x[self.drivers[lower]] - x[self.drivers[upper]], y[lower] - y[upper]
        apart = a.any(axis=1) & b.any(axis=1)
        return upper[apart], normalised(a[apart]), normalised(b[apart])

    @cached_property
    def soles(self) -> tuple[tuple[Sole, ...], ...]:
        """The soles of source and target for each leg. Bodies with the same rest pose share normals if only one shows
        them. Joints at the heel count if both have some. Without a target's foot, both are those of the ankle, unless
        an End Site shows that the leg ends on the floor.
        """
        normals = self.source_normals, self.target_normals
        if not self._soles or normals == (None, None):
            return self._soles
        sides = zip(zip(*self._soles, strict=True), normals, strict=True)
        source, target = (soles if known is None else with_normals(soles, known) for soles, known in sides)
        return tuple(zip(source, target, strict=True))

    @rig_property
    def _soles(self) -> tuple[tuple[Sole, ...], ...]:
        """The `soles` that poses show."""
        if self.legs is None:
            return ()
        feet = [*zip((self.source, self.target), self.legs, self.poses, strict=True)]
        source, target = self._own_soles
        if self.rest_poses_alike and not target[0].known:
            target = find_soles(*feet[1], tuple(sole.normal for sole in source))
        elif self.rest_poses_alike and not source[0].known:
            source = find_soles(*feet[0], tuple(sole.normal for sole in target))
        pairs = [
            (a, b) if a.heel.any() == b.heel.any() else (a.without_heel, b.without_heel)
            for a, b in zip(source, target, strict=True)
        ]
        ends = self.target.skeleton.end_sites & (self.target.anatomy is not None)
        footless = (leg.toe == leg.ankle and not ends[leg.ankle] for leg in self.legs[1])
        return tuple((a.at_ankle, b.at_ankle) if cut else (a, b) for cut, (a, b) in zip(footless, pairs, strict=True))

    @rig_property
    def _own_soles(self) -> tuple[tuple[Sole, ...], ...]:
        """The soles of source and target as each body shows them; empty without legs."""
        feet = zip((self.source, self.target), self.legs, self.poses, strict=True) if self.legs else ()
        return tuple(find_soles(*each) for each in feet)

    @property
    def with_resting_soles(self) -> Matching:
        """The same matching with the normals of the source's resting soles."""
        if self.legs is None:
            return self
        soles = tuple(sole for sole, _ in self.soles)
        normals = resting_normals(self.source_motion, self.legs[0], soles, self.source.up_vector)
        return replace(self, source_normals=normals)

    @property
    def with_untilted_soles(self) -> Matching:
        """The matching with soles corrected for feet that one rest pose tilts more than the other, as far
        as a motion shows it.
        """
        if self.legs is None:
            return self
        a, b = (leg_angles(legs, pose)[:, :2] for legs, pose in zip(self.legs, self.poses, strict=True))
        sides = zip((self.source, self.target), self.legs, zip(*self.soles, strict=True), (a - b, b - a), strict=True)
        source, target = (untilted_normals(*side) for side in sides)
        if source is None and target is None:
            return self
        return replace(self, source_normals=source or self.source_normals, target_normals=target or self.target_normals)

    @rig_property
    def turnout(self) -> Array:
        """(2,), how far the left and the right foot of the target turn to the left of the source's in the aligned poses
        [rad], if both stand; 0 for what differs by build.
        """
        both_stand = self.in_reference and self.source.stands and self.target.stands
        if self.legs is None or not both_stand:
            return np.zeros(2)
        ahead = [leg_angles(legs, pose)[:, 2] for legs, pose in zip(self.legs, self.poses, strict=True)]
        turned = (ahead[1] - ahead[0] + np.pi) % (2.0 * np.pi) - np.pi
        return np.asarray(turned * smoothstep(np.abs(turned) / FEET_BUILD - 1.0))

    def with_mesh_soles(self, mesh: SkinnedMesh | None) -> Matching:
        """Return the matching with the soles that the target's mesh shows, also for a source that is the same rig."""
        if self.legs is None or mesh is None:
            return self
        found = flat_normals(self.target, self.legs[1], tuple(own for _, own in self._soles), mesh)
        return replace(self, source_normals=found if self.is_same_rig else None, target_normals=found)

    @rig_property
    def pelvis(self) -> int:
        """The target joint where the legs branch off, if it has a driver; else the first joint with a driver."""
        first = int(np.argmax(self.drivers >= 0))
        joint = self.target.pelvis_joint if self.legs else None
        return first if joint is None or self.drivers[joint] < 0 else joint


def cached_by_soles(function: Callable[[Matching], Found]) -> Callable[[Matching], Found]:
    """Decorate a function of a matching and its soles: cache the result for all clips of the same rigs if possible."""
    found: WeakKeyDictionary[Matching, Found] = WeakKeyDictionary()

    @wraps(function)
    def find(matching: Matching) -> Found:
        by_poses = matching.source_normals is None and matching.target_normals is None
        owner = matching.rig if matching.rig and by_poses else matching
        if owner not in found:
            found[owner] = function(owner)
        return found[owner]

    return find


@lru_cache(maxsize=CACHED_RIGS)
def _rig(
    source: Body, target: Body, drivers: bytes, rotation_sources: bytes, blend: bytes, method: tuple[str, ...]
) -> Matching | None:
    """`Matching.rig` of two rigs."""
    rig = Matching(
        source=source,
        target=target,
        drivers=np.frombuffer(drivers, np.intp),
        rotation_sources=np.frombuffer(rotation_sources, np.intp).reshape(-1, 2),
        blend=np.frombuffer(blend),
        method=method,
    )
    vars(rig)["rig"] = rig  # fill the cached property
    known = not rig._only_source_feet_bend and all(sole.known for soles in rig._own_soles for sole in soles)
    return rig if known else None


def match(source: Body, target: Body, joint_map: JointMap | None = None) -> Matching:
    """Match the joints of two bodies (`find_matching`), and check that the matching suffices to retarget a motion.

    Raises:
        MatchingError: it does not; the message says why, and which names are most similar.
        MapError: `joint_map` names joints that do not exist.
    """
    check_kind("source", source, Body)
    check_kind("target", target, Body)
    check_kind("joint_map", joint_map, Mapping, NoneType)
    matching = find_matching(source, target, joint_map)
    if reason := refusal(matching):
        source_keys, target_keys = ([body.skeleton.keys[j] for j in body.skeleton.joints] for body in (source, target))
        raise MatchingError(reason, source_keys, target_keys)
    return matching


def find_matching(source: Body, target: Body, joint_map: JointMap | None = None) -> Matching:
    """Match as many joints as possible, without IK handles, by `joint_map`, names or shape; or a MapError."""
    if source.left_is_left is not None and target.left_is_left is not None:
        source, target = (body if body.left_is_left else body.mirrored for body in (source, target))
    swapped = [body.anatomy.swapped_sides if body.anatomy else "" for body in (source, target)]
    crossed = swapped[0] != swapped[1]  # whether left and right are swapped in names of one body
    map_pairs = pairs_of_map(source.skeleton, target.skeleton, joint_map or {})
    drivers, rotation_sources, blend, method = _paired(source, target, crossed, tuple(map_pairs.items()))
    return Matching(
        source=source, target=target, drivers=drivers, rotation_sources=rotation_sources, blend=blend, method=method
    )


@rig_cached
def _paired(
    source: Body, target: Body, crossed: bool, mapped: tuple[tuple[int, tuple[int, str]], ...]
) -> tuple[Numbers, Numbers, Array, tuple[str, ...]]:
    """Drivers, rotation sources, blend and method of a matching, with the pairs of a map."""
    found_pairs, map_pairs = find_pairs(source, target, crossed), dict(mapped)
    pairs = with_tips(source, target, found_pairs | map_pairs)
    for joint in pairs.keys() - map_pairs.keys():
        if joint in target.handles or pairs[joint][0] in source.handles:
            del pairs[joint]
    found = [pairs.get(joint, (-1, "")) for joint in range(len(target.skeleton))]
    drivers = np.array([driver for driver, _ in found], np.intp)
    method = tuple(method if driver >= 0 else "" for driver, method in found)
    overruled = {joint for joint in map_pairs if map_pairs[joint][0] != found_pairs.get(joint, (None, ""))[0]}
    rotation_sources, blend = np.stack([drivers, drivers], axis=1), np.zeros(len(drivers))
    rotation_sources[[joint for joint in target.roles.values() if target.skeleton.end_sites[joint]]] = -1
    for joint, neighbours, weight in spine_blend(source, target):
        if joint not in overruled:
            rotation_sources[joint], blend[joint] = neighbours, weight
    return read_only(drivers), read_only(rotation_sources), read_only(blend), method


def refusal(matching: Matching) -> str:
    """Return why a motion cannot be retargeted by this matching; empty if it can."""
    joints = matching.target.skeleton.joints
    named = sum(matching.method[joint] in ("name", "map") for joint in joints)
    s, t = matching.source.anatomy, matching.target.anatomy
    shared = s and t and any(role in s.roles and role in t.roles for role in LIMB_ROLES)
    limbs = [t.roles[role] for role in LIMB_ROLES if role in t.roles] if t else []
    lost = bool(limbs) and not shared and not (matching.drivers[limbs] >= 0).any()
    enough = named >= NAMED_SHARE * len(joints)
    if "map" in matching.method:
        return ""
    flat = [body.skeleton.is_flat for body in (matching.source, matching.target)]
    if flat[0] != flat[1]:
        which = "source" if flat[0] else "target"
        return f"the tree of the {which} is flat: its joints hang from the root, not from each other"
    if enough and not lost:
        return ""
    if not (s and t):
        body = "the source" if t else "the target" if s else "either of them"
        few = f"only {named} of {len(joints)} joints of the target have a driver by name"
        return f"{'no arm and no leg has a driver' if enough else few}, and no human body is recognised in {body}"
    for name, side in (("source", matching.source), ("target", matching.target)):
        if side.on_all_fours:
            return f"the {name} seems to go on all fours: its trunk lies across its legs"
    if not shared:
        return "source and target share neither arms nor legs"
    return "" if (matching.drivers >= 0).any() else "no joint of the target has a driver"
