"""The postures in which two bodies are laid upon each other, and the rotations that do it.

A rest pose in which a person can stand (T, A, arms down) serves as it is. One that is none (all bones along one axis)
is replaced: for a body in motion by the frame in which it stands most like a rest pose, else by one put together.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.alignment import best_rotation
from distretarget.anatomy import ARM, LEG, SIDES, Anatomy
from distretarget.matching import Matching
from distretarget.motion import Motion
from distretarget.orientation import body_axes, is_pose, leg_directions, trunk, unit
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]

BUILD = np.radians(55)  # bones of trunk, hands and feet whose rest directions differ by less differ in build only
LONG = ("UpperArm", "LowerArm", "UpperLeg", "LowerLeg")  # whose bones are laid upon each other exactly
BUILT = ("hips", "head", "Shoulder", "Foot", "Toes")  # whose bones never are
SQUARE = np.radians(25)  # a body that stands so nearly along the axes stands along them
PITCH = np.radians(25)  # by which a foot points below the floor's plane where its rest pose does not say
OPPOSITE = -0.9  # cosine below which a bone is turned right round about the axis from side to side
NOWHERE = np.array([0.0, 0.0, 0.0, 1.0])


def rest_alignment(matching: Matching, motion: Motion, up: Array) -> Array:
    """A: (target joints, 2, 4), the rotations that take a target joint's rest pose onto that of the source joints whose
    rotations it follows (`Matching.turns`), so that R A is the target's world rotation for the source's R.

    Trunk, hands and feet, whose bones lie differently in every build, are aligned as what they hang from, and in the end
    as the bodies are, axis by axis; arms and legs bone by bone, by least rotations from the part above, which leave the
    roll to it.

    `motion` is the source's; `up`, (3,), points up in it.
    """
    s, t = matching.anatomies
    theirs, ours = np.tile(NOWHERE, (len(matching.source), 1)), np.tile(NOWHERE, (len(matching.target), 1))
    if s and t and not _alike(matching):
        theirs, ours = standing_frame(motion, s, up), stood(matching.target, t)
    posed = Rotation.from_quat(theirs), Rotation.from_quat(ours)
    onto = Rotation.from_quat(_laid_upon(matching, theirs, ours))
    turns = np.maximum(matching.turns, 0)
    return np.stack([(posed[0][turns[:, k]].inv() * onto * posed[1]).as_quat() for k in (0, 1)], axis=1)


def standing_frame(motion: Motion, anatomy: Anatomy, up: Array) -> Array:
    """(joints, 4), world rotations in which the body stands: none where the rest pose is a pose, else those of the frame
    that is most like one: upright, legs straight, arms hanging or out to the sides.
    """
    skeleton = motion.rigid_skeleton
    if is_pose(skeleton, anatomy) or not len(motion):
        return np.tile(NOWHERE, (len(skeleton), 1))
    x = motion.positions
    unlike = (1.0 - trunk(anatomy, x) @ up) + (1.0 + leg_directions(anatomy, x) @ up)
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        outwards = sign * body_axes(anatomy, x)[..., 0]
        for upper, lower in _bones(anatomy, side, ARM[1:]):
            bone = unit(x[:, lower] - x[:, upper])
            unlike += 0.25 * (1.0 - np.maximum((bone * outwards).sum(axis=-1), -(bone @ up)))
    return np.array(motion.world_rotations[np.argmin(unlike)])


def stood(skeleton: Skeleton, anatomy: Anatomy) -> Array:
    """(joints, 4), world rotations in which the body stands: none where the rest pose is a pose, else those that put
    together a T-pose: Y up, facing Z.

    Each joint is turned from the one above by the least rotation, but where that is right round, about the axis from
    side to side, as knees bend.
    """
    if is_pose(skeleton, anatomy):
        return np.tile(NOWHERE, (len(skeleton), 1))
    goals = dict(_goals(skeleton, anatomy))
    hips = Rotation.from_matrix(body_axes(anatomy, skeleton.rest_positions).T)
    turns: list[Rotation] = []
    for joint in range(len(skeleton)):
        turn = turns[skeleton.parents[joint]] if joint else hips
        if joint in goals:
            tip, goal = goals[joint]
            bone = unit(turn.apply(skeleton.rest_positions[tip] - skeleton.rest_positions[joint]))
            if bone @ goal < OPPOSITE:
                turn = Rotation.from_rotvec([np.pi, 0.0, 0.0]) * turn
                bone = bone * [1.0, -1.0, -1.0]
            turn = _least(bone[None], goal[None]) * turn
        turns.append(turn)
    return np.array([turn.as_quat() for turn in turns])


def _goals(skeleton: Skeleton, anatomy: Anatomy) -> Iterator[tuple[int, tuple[int, Array]]]:
    """For joints of a T-pose the joint at the end of their bone, and where the bone points."""
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        for upper, lower in _bones(anatomy, side, ARM):
            yield upper, (lower, np.array([sign, 0.0, 0.0]))
        for upper, lower in _bones(anatomy, side, LEG[:3]):
            yield upper, (lower, np.array([0.0, -1.0, 0.0]))
        for upper, lower in _bones(anatomy, side, LEG[2:]):
            yield upper, (lower, np.array([0.0, -np.sin(PITCH), np.cos(PITCH)]))


def _bones(anatomy: Anatomy, side: str, limb: tuple[str, ...]) -> list[tuple[int, int]]:
    """The joints at both ends of each bone of a limb that has them."""
    joints = [anatomy.roles[side + role] for role in limb if side + role in anatomy.roles]
    return list(zip(joints, joints[1:], strict=False))


def _laid_upon(matching: Matching, theirs: Array, ours: Array) -> Array:
    """M: (target joints, 4), the rotations that lay each target joint, standing in the world rotations `ours`, upon the
    source, standing in `theirs`.
    """
    x, y = standing_positions(matching.source, theirs), standing_positions(matching.target, ours)
    body, outwards = _body_turn(matching, x, y)
    build, feet = _built(matching)
    laid: list[Rotation] = []
    for joint, handles in enumerate(_handles(matching, x, y)):
        turn = body if not joint or joint in feet else laid[matching.target.parents[joint]]
        if handles:
            a, b = unit(y[handles] - y[joint]), unit(x[matching.drivers[handles]] - x[matching.drivers[joint]])
            if joint in outwards:
                turn = _least(turn.apply(a[:1]), outwards[joint][None]) * turn
            least = _least(turn.apply(a), b)
            if joint not in build or (len(handles) == 1 and least.magnitude() > BUILD):
                turn = least * turn
        laid.append(turn)
    return np.array([turn.as_quat() for turn in laid])


def standing_positions(skeleton: Skeleton, world: Array) -> Array:
    """(joints, 3), where the joints are in given world rotations (joints, 4), the root at the origin."""
    x = np.zeros((len(skeleton), 3))
    for joint in range(1, len(skeleton)):
        parent = skeleton.parents[joint]
        x[joint] = x[parent] + Rotation.from_quat(world[parent]).apply(np.array(skeleton.offsets[joint]))
    return x


def _body_turn(matching: Matching, x: Array, y: Array) -> tuple[Rotation, dict[int, Array]]:
    """The rotation that lays the target's body, standing at `y` (joints, 3), upon the source's at `x`; and for the
    target's upper arms the direction out to the source's side, through which they are turned: so a target in A-pose is
    laid like the same in T-pose.
    """
    s, t = matching.anatomies
    if s is None or t is None:
        return Rotation.identity(), {}
    theirs, ours = _axes(s, x), _axes(t, y)
    upper = [(t.roles.get(f"{side}UpperArm", -1), sign) for side, sign in zip(SIDES, (1.0, -1.0), strict=True)]
    turn = Rotation.identity() if _alike(matching) else Rotation.from_matrix(theirs @ ours.T)
    return turn, {joint: sign * theirs[:, 0] for joint, sign in upper}


def _axes(anatomy: Anatomy, x: Array) -> Array:
    """(3, 3), left, up and forward of a body that stands at positions (joints, 3); the file's axes, if it stands nearly
    along them.
    """
    axes = body_axes(anatomy, x)
    largest = np.argmax(np.abs(axes), axis=0)
    square = np.zeros((3, 3))
    square[largest, range(3)] = np.sign(axes[largest, range(3)])
    if np.linalg.det(square) < 0.5:
        return axes
    return square if Rotation.from_matrix(axes.T @ square).magnitude() < SQUARE else axes


def _built(matching: Matching) -> tuple[set[int], set[int]]:
    """The target's joints of trunk, shoulders, hands and feet, whose bones lie differently in every build; and of these
    the ankles, which are laid as the body is and not as the leg. Where the source stands in a frame of its motion, spine
    and hands are not among them: there they may be bent.
    """
    source, anatomy = matching.anatomies
    if anatomy is None or source is None:
        return set(), set()
    hips = anatomy.roles.get("hips", 0)
    built = {joint for role, joint in anatomy.roles.items() if role.endswith(BUILT)} | {*matching.target.ancestors(hips)}
    if is_pose(matching.source, source) or _alike(matching):
        built |= {joint for role, joint in anatomy.roles.items() if not role.endswith(LONG)}
        built |= {*anatomy.spine, *anatomy.neck}
    return built, {anatomy.roles[f"{side}Foot"] for side in SIDES if f"{side}Foot" in anatomy.roles}


def _handles(matching: Matching, x: Array, y: Array) -> list[list[int]]:
    """Per target joint with a driver, the nearest driven joints below it that are apart from it on both bodies."""
    handles: list[list[int]] = [[] for _ in matching.drivers]
    for joint in range(1, len(handles)):
        if matching.drivers[joint] < 0:
            continue
        above = int(matching.target.parents[joint])
        while above >= 0 and matching.drivers[above] < 0:
            above = int(matching.target.parents[above])
        theirs = matching.drivers[[joint, above]]
        if above >= 0 and (y[joint] != y[above]).any() and (x[theirs[0]] != x[theirs[1]]).any():
            handles[above].append(joint)
    return handles


def _alike(matching: Matching) -> bool:
    """Whether all bones of both rest poses point the same way, so that nothing needs to stand up."""
    x, y = matching.source.rest_positions, matching.target.rest_positions
    for joint, handles in enumerate(_handles(matching, x, y)):
        a, b = unit(y[handles] - y[joint]), unit(x[matching.drivers[handles]] - x[matching.drivers[joint]])
        if ((a * b).sum(axis=1) < np.cos(BUILD)).any():
            return False
    return True


def _least(a: Array, b: Array) -> Rotation:
    """The rotation that takes vectors a (vectors, 3) nearest to b."""
    return Rotation.from_quat(best_rotation(a[None], b[None])[0])
