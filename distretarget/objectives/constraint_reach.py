"""Bends limbs until user constraints are met: arms, or legs where both parts are on legs.

The solver has brought the parts near each other, with the trunk and all limbs; limbs close what is left. Arms that
would meet inside the trunk are first moved out of it, forwards. Directions of head, hands and feet are set here, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.body import Body
from distretarget.body.build import capsules_by_build
from distretarget.contact_entries import Contact, Look, Place, Plant
from distretarget.motion import Motion
from distretarget.numerics.quaternions import least_rotation
from distretarget.numerics.rotations import continuous
from distretarget.numerics.time_series import smoothstep
from distretarget.numerics.vectors import Array, Numbers, cross, lengths, normalised
from distretarget.objectives.body_skin import BodySkin, Skins
from distretarget.objectives.constraint_springs import correction
from distretarget.objectives.constraints import Constraint, Constraints
from distretarget.objectives.part_axes import PARTS
from distretarget.objectives.supports import Supports
from distretarget.skin.capsules import GROUP, SEGMENTS, TRUNK_SEGMENTS
from distretarget.skin.fit import distances
from distretarget.skin.limbs import Limb, across, bent, reaching

FOREARM = 0.5  # a point on a forearm moves by about this share of the wrist's displacement
STEPS = np.linspace(0.0, 0.5, 26)  # distances that are tried to move arms out of the trunk [body units]
OUTWARDS, DOWN = 0.6, 0.8  # the usual direction of elbows of reaching arms, from the trunk
ASIDE = np.radians(25.0)  # the largest angle between a hand that faces an anchor and its forearm [rad]
POLES = normalised(np.array([each for each in product((-1.0, 0.0, 1.0), repeat=3) if any(each)]))
USUAL = 0.3  # other elbow directions have to save this much depth to be taken [radii of the arm]
SEEN = 6  # at most this many frames decide the direction of an elbow
ALONG = np.array([0.5, 0.75, 1.0])  # fractions along upper arm and forearm at which their depth is found
OUT = 0.15  # arms begin to leave the trunk twice this time before they have to [s]
TRUNK = [SEGMENTS.index(name) for name in (*TRUNK_SEGMENTS, "left thigh", "right thigh")]


@dataclass(frozen=True, eq=False)
class LimbReach:
    """Moves the limbs of a body so that user constraints are met; methods take the weights of these, (frames,) each."""

    constraints: Constraints
    supports: Supports
    body: Body
    skins: Skins | None  # None for a stick figure

    @cached_property
    def skin(self) -> BodySkin:
        """The skin of the body; an average body's for a stick figure."""
        return self.skins.target if self.skins else BodySkin.of(self.body, capsules_by_build(self.body))

    def displacements(self, motion: Motion, weights: Sequence[Array]) -> tuple[Array, Array]:
        """Return the weighted displacements of the ends of limbs that meet the constraints in a motion, (frames, limbs,
        3) [file units], and for each limb the largest of the weights, (frames, limbs).
        """
        constraints, limbs = self.constraints, self.skin.limbs
        displacements, firmness = np.zeros((len(motion), len(limbs), 3)), np.zeros((len(motion), len(limbs)))
        for constraint, weight in zip(constraints, weights, strict=True):
            moving = _moving(constraints, constraint, self.supports, limbs) if weight.any() else []
            if moving:
                needed = correction(constraints, constraint, motion, self.supports, self.skins)
                needed, total = weight[:, None] * constraints.clip.unit * needed, sum(free for _, _, free, _ in moving)
                for number, sign, free, share in moving:
                    part = np.divide(free, total, out=np.zeros_like(free), where=total > 0.0)
                    displacements[:, number] += (sign / share * part * free)[:, None] * needed
                    firmness[:, number] = np.maximum(firmness[:, number], weight * (part > 0.0))
        return displacements, firmness

    def with_gaps_closed(self, motion: Motion, weights: Sequence[Array], steady: float) -> Motion:
        """Return a motion whose limbs are moved to meet contacts, distances and planted parts. Displacements are
        averaged over the time `steady` before and after each frame [s]. Hands turn first, so that their anchors face
        the anchors that they touch.
        """
        for constraint, weight in zip(self.constraints, weights, strict=True):
            motion = self._with_anchors_facing(motion, constraint, weight)
        return self._moved(motion, self.displacements(motion, weights)[0], steady)

    def _with_anchors_facing(self, motion: Motion, constraint: Constraint, weight: Array) -> Motion:
        """The motion with hands turned so that the two anchors of a contact face each other, and the hands are about in
        line with their forearms.
        """
        anchors = (constraint.anchors or ())[:2]
        moving = _moving(self.constraints, constraint, self.supports, self.skin.limbs) if anchors else []
        arms = [(limb, free) for number, _, free, _ in moving if (limb := self.skin.limbs[number]).is_arm]
        turns = list[tuple[int, Array]]()
        for one, other in (anchors, anchors[::-1]) if anchors else ():
            for arm, free in arms:
                if one.joint in motion.skeleton.subtree(arm.end):
                    out, bone = other.normals(motion), motion.positions[:, arm.end] - motion.positions[:, arm.middle]
                    turn = Rotation.from_quat(least_rotation(one.normals(motion), -out))
                    hand = turn.apply(one.axis_directions(motion))
                    spin = np.arctan2((cross(hand, bone) * out).sum(axis=1), (across(hand, out) * bone).sum(axis=1))
                    spin = (spin - ASIDE * np.sin(spin)) * smoothstep(lengths(across(normalised(bone), out)))
                    turn = Rotation.from_rotvec(spin[:, None] * out) * turn
                    turns.append((arm.end, (free * weight)[:, None] * _unwrapped(turn, weight)))
        for joint, v in turns:
            goal = Rotation.from_rotvec(v / len(turns)) * Rotation.from_quat(motion.world_rotations_of(joint))
            motion = _turned(motion, joint, goal, v.any(axis=1).astype(float))
        return motion

    def arms_out_of_trunk(self, motion: Motion, weights: Sequence[Array]) -> Motion:
        """Return a motion in which the arms of user contacts are moved out of the trunk, forwards."""
        constraints, body, limbs = self.constraints, self.body, self.skin.limbs
        each = zip(constraints, weights, strict=True)
        contacts = [(constraint, weight) for constraint, weight in each if isinstance(constraint.entry, Contact)]
        if not contacts:
            return motion
        clip, moved = constraints.clip, np.zeros((len(motion), len(limbs), 3))
        spine = body.anatomy.spine if body.anatomy else ()
        front, posed = front_of(body, motion, spine[-1] if spine else clip.pelvis), self.skin.posed(motion)
        for constraint, weight in contacts:
            moving = _moving(constraints, constraint, self.supports, limbs)
            on, out = np.flatnonzero(constraint.frames), np.zeros(len(motion))
            out[on] = _distance_out(self.skin, posed[on], np.concatenate(constraint.joints), front[on])
            out = clip.averaged(clip.widened(out[:, None], OUT)[:, 0], OUT)
            for number, _, free, _ in moving:
                if limbs[number].is_arm:
                    moved[:, number] += (free * weight * out)[:, None] * clip.unit * front
        return self._moved(motion, moved, 0.0)

    def _moved(self, motion: Motion, displacements: Array, steady: float) -> Motion:
        """The motion with the ends of limbs displaced, (frames, limbs, 3) [file units], as far as limbs reach."""
        clip, limbs = self.constraints.clip, self.skin.limbs
        if not displacements.any():  # as on figures of blocks, whose limbs do not bend
            return motion
        displacements = clip.averaged(displacements, steady) * (self.constraints.share > 0.0)[:, None, None]
        poles, firmness = self._poles(motion, displacements)
        displaced = [
            reaching(motion, limb, displacements[:, n], poles[:, n], firmness[:, n]) for n, limb in enumerate(limbs)
        ]
        return _bent_in_steps(motion, limbs, clip.averaged(np.stack(displaced, axis=1), steady))

    def _poles(self, motion: Motion, displacements: Array) -> tuple[Array, Array]:
        """The pole vectors of limbs, (frames, limbs, 3), and their weights, (frames, limbs). Elbows point down and
        outwards, those of arms with anchors to where the arm is outside of the trunk; legs have no pole vectors.
        """
        landmarks, limbs, constraints = self.skin.landmarks, self.skin.limbs, self.constraints
        poles, firmness = np.zeros((len(motion), len(limbs), 3)), np.zeros((len(motion), len(limbs)))
        if landmarks is None:
            return poles, firmness
        trunk = landmarks.axes(motion).directions[:, [*PARTS].index("trunk")]
        for constraint in filter(lambda each: each.anchors, constraints):
            for number, *_ in _moving(constraints, constraint, self.supports, limbs):
                firmness[:, number] = np.maximum(firmness[:, number], constraint.weight)
        for number, limb in enumerate(limbs):
            if limb.is_arm:
                side = 1.0 if landmarks.joints["leftUpperArm"] == limb.top else -1.0
                pole = np.array([-DOWN, 0.0, side * OUTWARDS])
                on = np.flatnonzero(firmness[:, number] == firmness[:, number].max(initial=1e-9))
                if len(on):
                    on = on[:: -(-len(on) // SEEN)]
                    pole = self._pole_outside(motion[on], limb, displacements[on, number], trunk[on], pole)
                poles[:, number] = pole @ trunk
        return poles, firmness

    def _pole_outside(self, motion: Motion, limb: Limb, by: Array, trunk: Array, usual: Array) -> Array:
        """(3,), in the axes of the trunk, (frames, 3, 3), the pole vector that keeps an arm out of the body best while
        its end is displaced by vectors, (frames, 3); the `usual` one if no other is clearly better.
        """
        skin, count = self.skin, len(POLES)
        on, thick = np.isin(skin.capsules.segments, TRUNK), skin.unit * skin.thickness(limb.middle)
        if not on.any() or not thick:
            return usual
        many = motion[np.repeat(np.arange(len(motion)), count)]
        poles = (POLES @ trunk).reshape(-1, 3)
        moved = reaching(many, limb, np.repeat(by, count, axis=0), poles, 1.0)
        top, middle, end = (many.positions[:, joint] for joint in limb.joints)
        middle, end, t = middle + moved[:, 0], end + moved[:, 1], ALONG[:, None, None]
        points = np.concatenate([top + t * (middle - top), middle + t * (end - middle)]).swapaxes(0, 1)
        ends = np.repeat(skin.capsules[on].posed(motion), count, axis=0)
        inside = np.maximum(1.0 - distances(points, ends, skin.capsules.radii[on])[0] / thick, 0.0).sum(axis=1)
        return np.asarray(POLES[(inside.reshape(-1, count).mean(axis=0) - USUAL * POLES @ usual).argmin()])


def _bent_in_steps(motion: Motion, limbs: Sequence[Limb], displacements: Array) -> Motion:
    """The motion with middles and ends of limbs displaced, (frames, limbs, 2, 3) [file units]. Limbs turn as a whole
    first, and then bend: in one step a forearm may turn by 180 degrees, about any axis, and its twist would jump.
    """
    whole, joints = displacements.copy(), np.array([limb.joints for limb in limbs], np.intp).reshape(-1, 3)
    bones = np.diff(motion.positions[:, joints], axis=2)
    turned = least_rotation(bones[:, :, 0].reshape(-1, 3), (bones[:, :, 0] + whole[:, :, 0]).reshape(-1, 3))
    lower = Rotation.from_quat(turned).apply(bones[:, :, 1].reshape(-1, 3)).reshape(bones[:, :, 1].shape)
    whole[:, :, 1] = whole[:, :, 0] + lower - bones[:, :, 1]
    return bent(bent(motion, limbs, whole), limbs, displacements - whole)


def _moving(
    constraints: Constraints, constraint: Constraint, supports: Supports, limbs: Sequence[Limb]
) -> list[tuple[int, float, Array, float]]:
    """The limbs that can be moved to meet a constraint: index, sign of the displacement, how free each is, (frames,),
    and the share of its end's displacement by which the part moves. Legs are left out if an arm can move.
    """
    found, skeleton, pair = [], constraints.clip.skeleton, constraint.pair
    planted = pair is None and isinstance(constraint.entry, Plant) and constraint.entry.keep
    joints = (int(constraint.joints[0][0]),) if planted else pair or ()
    for joint, sign in zip(joints, (1.0, -1.0), strict=False):
        for number, limb in enumerate(limbs):
            moves = joint != limb.middle or len(constraint.joints[0]) > 1 or constraint.anchors
            if moves and joint in skeleton.subtree(limb.middle):
                below = np.isin(supports.joints, [*skeleton.subtree(limb.end)])
                free = 1.0 - supports.weights[:, below].max(axis=1, initial=0.0)
                free = np.ones_like(free) if planted else free
                share = 1.0 if joint in skeleton.subtree(limb.end) else FOREARM
                found.append((number, sign, free, share))
    arms = [each for each in found if limbs[each[0]].is_arm]
    return arms if arms or planted else found


def _distance_out(skin: BodySkin, posed: Array, parts: Numbers, front: Array) -> Array:
    """(frames,), the least of `STEPS` by which the limbs of a contact's `parts` have to move along `front`, (frames,
    3), to leave trunk, thighs and head, unless the contact is with these [body units]; 0 if no step is enough.
    """
    balls, segments, caps = skin.balls, np.unique(skin.of_joint[parts]), skin.capsules.segments
    own = np.flatnonzero(np.isin(caps[balls.carriers], np.setdiff1d(segments, TRUNK)))
    others = np.flatnonzero(np.isin(caps, [each for each in TRUNK if GROUP[each] not in GROUP[segments]]))
    if not len(own) or not len(others):
        return np.zeros(len(posed))
    t = balls.fractions[own, None]
    p = (1.0 - t) * posed[:, balls.carriers[own], 0] + t * posed[:, balls.carriers[own], 1]
    p = p[:, None] + STEPS[:, None, None] * front[:, None, None]
    clear = np.ones((len(posed), len(STEPS)), bool)
    for each in others.tolist():
        a, axis, radii = posed[:, each, 0], posed[:, each, 1] - posed[:, each, 0], balls.cap_radii[each]
        off = p - a[:, None, None]
        along = np.einsum("fsbi,fi->fsb", off, axis) / np.maximum((axis**2).sum(axis=1), 1e-12)[:, None, None]
        along = np.clip(along, 0.0, 1.0)
        distance = lengths(off - along[..., None] * axis[:, None, None])
        least = (1.0 - along) * radii[0] + along * radii[1] + balls.radii[own]
        clear &= (distance >= least + np.minimum(balls.gap_offsets[own, each], 0.0)).all(axis=2)
    return np.where(clear.any(axis=1), STEPS[clear.argmax(axis=1)], 0.0)


# ---- direction constraints: head, hands and feet turned as in the source, or with their front in a given direction


def with_looks(posed: Motion, constraints: Constraints, body: Body) -> Motion:
    """Return the motion with the parts of direction constraints turned, and all that they carry with them."""
    clip = constraints.clip
    for constraint in constraints:
        if isinstance(constraint.entry, Look):
            first = int(constraint.joints[0][0])  # the region of the head begins at the neck
            joint = body.roles.get(constraint.entry.look, first)
            goal = Rotation.from_quat(clip.copy.world_rotations[:, joint])
            if constraint.entry.like != "source":
                goal = _facing(goal, constraint.entry.like, front_of(body, clip.copy, joint))
            posed = _turned(posed, joint, goal, constraints.firmness(constraint))
    return posed


def front_of(body: Body, motion: Motion, joint: int) -> Array:
    """(frames, 3), the direction of a joint's front, which in the reference pose is the front of the body."""
    pose = body.reference
    front = Rotation.from_quat(pose.rotations[joint]).inv().apply(pose.axes[:, 2])
    return np.asarray(Rotation.from_quat(motion.world_rotations_of(joint)).apply(front))


def _facing(turned: Rotation, direction: Place, now: Array) -> Rotation:
    """World rotations of a joint, turned by the least rotations from its present front, `now`, to a direction."""
    goal = np.broadcast_to(np.array(direction, float), now.shape)
    return Rotation.from_quat(least_rotation(now, goal)) * turned


def _turned(posed: Motion, joint: int, goal: Rotation, weight: Array) -> Motion:
    """The motion with a joint turned towards world rotations, by a weight from 0 to 1 in each frame."""
    on, parent = weight > 0.0, posed.skeleton.parents[joint]
    world = Rotation.from_quat(posed.world_rotations[on, joint])
    turned = Rotation.from_rotvec(weight[on, None] * (goal[on] * world.inv()).as_rotvec()) * world
    above = Rotation.from_quat(posed.world_rotations[on, parent]) if joint else None
    rotations = np.array(posed.rotations)
    rotations[on, joint] = (above.inv() * turned if above else turned).as_quat()
    return replace(posed, rotations=rotations)


def _unwrapped(turns: Rotation, weight: Array) -> Array:
    """The rotation vectors, (frames, 3), of rotations, continuous over time: their angles may exceed 180 degrees, but
    are less on most frames in which the weight, (frames,), is largest.
    """
    q = continuous(turns.as_quat()[:, None])[:, 0]
    q *= 1.0 if np.median(q[weight == weight.max(), 3]) >= 0.0 else -1.0
    sines = lengths(q[:, :3])[:, None]
    return np.asarray(
        2.0 * np.arctan2(sines, q[:, 3:]) * np.divide(q[:, :3], sines, out=0.0 * q[:, :3], where=sines > 0.0)
    )
