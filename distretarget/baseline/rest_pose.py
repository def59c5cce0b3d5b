"""Two bodies laid upon each other by their rest poses: the rotations that turn the one's joints into the other's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import SIDES
from distretarget.body.axes import body_axes, is_pose, squared, unit, upright
from distretarget.body.reference_pose import bend_axes, resting, standing, standing_positions
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.numerics.rotations import least

Array = NDArray[np.float64]

BUILD = np.radians(55)  # bones of trunk, hands and feet whose rest directions differ by less differ in build only
LONG = ("UpperArm", "LowerArm", "UpperLeg", "LowerLeg")  # whose bones are laid upon each other exactly
BUILT = ("hips", "head", "Shoulder", "Foot", "Toes")  # whose bones never are


def rest_alignment(matching: Matching, motion: Motion, up: Array, target_motion: Motion | None = None) -> Array:
    """A: (target joints, 2, 4), the rotations that take a target joint's rest pose onto that of the source joints whose
    rotations it follows (`Matching.turns`), so that R A is the target's world rotation for the source's R.

    Trunk, hands and feet, whose bones lie differently in every build, are aligned as what they hang from, and in the
    end as the bodies are, axis by axis; arms and legs bone by bone, by least rotations from the part above, which leave
    the roll to it. Where a rest pose is none, and a frame of motion stands for it, the axes about which elbows and
    knees bend in the motion tell the roll.

    `motion` is the source's, `target_motion` any of the target's; `up`, (3,), points up in both.
    """
    s, t = matching.anatomies
    theirs, ours = resting(matching.source), resting(matching.target)
    bends: tuple[dict[str, Array], dict[str, Array]] = {}, {}
    framed = False
    if s and t and not _alike(matching):
        framed = not is_pose(matching.source, s) or not (target_motion is None or is_pose(matching.target, t))
        theirs, ours = standing(matching.source, s, motion, up), standing(matching.target, t, target_motion, up)
        bends = bend_axes(matching.source, s, motion, theirs), bend_axes(matching.target, t, target_motion, ours)
    posed = Rotation.from_quat(theirs), Rotation.from_quat(ours)
    onto = Rotation.from_quat(_laid_upon(matching, theirs, ours, bends, _built(matching, framed)))
    turns = np.maximum(matching.turns, 0)
    return np.stack([(posed[0][turns[:, k]].inv() * onto * posed[1]).as_quat() for k in (0, 1)], axis=1)


def _laid_upon(
    matching: Matching,
    theirs: Array,
    ours: Array,
    bends: tuple[dict[str, Array], dict[str, Array]],
    built: set[int],
) -> Array:
    """M: (target joints, 4), the rotations that lay each target joint, standing in the world rotations `ours`, upon the
    source, standing in `theirs`. `bends` has the axes about which limbs bend where the bodies stand so, as `bend_axes`,
    `built` the target's joints whose bones are not laid upon the source's.
    """
    x, y = standing_positions(matching.source, theirs), standing_positions(matching.target, ours)
    bodies = _bodies(matching, x, y)
    ankles = _ankles(matching)
    laid: list[Rotation] = []
    for joint, handles in enumerate(_handles(matching, x, y)):
        turn = bodies.turn if not joint or joint in ankles else laid[matching.target.parents[joint]]
        if handles:
            a, b = unit(y[handles] - y[joint]), unit(x[matching.drivers[handles]] - x[matching.drivers[joint]])
            if joint in bodies.outwards:
                turn = least(turn.apply(a[:1]), bodies.outwards[joint][None]) * turn
            onto = least(turn.apply(a), b)
            if joint in bodies.hinges:
                role, usual = bodies.hinges[joint]
                wanted = bends[0].get(role, onto.apply(usual))
                found = (onto * turn).apply(bends[1][role]) if role in bends[1] else onto.apply(usual)
                onto = _rolled(b[0], found, wanted) * onto
            if joint not in built or (len(handles) == 1 and onto.magnitude() > BUILD):
                turn = onto * turn
        laid.append(turn)
    return np.array([turn.as_quat() for turn in laid])


def _rolled(bone: Array, axis: Array, wanted: Array) -> Rotation:
    """The rotation about a bone that takes an axis, (3,), as near as it can to another."""
    across, goal = (vector - (vector @ bone) * bone for vector in (axis, wanted))
    angle = np.arctan2(np.cross(across, goal) @ bone, across @ goal)
    return Rotation.from_rotvec(angle * bone)


@dataclass(frozen=True)
class _Bodies:
    """How a target's body is laid upon a source's.

    Attributes:
        turn: that lays the body as a whole.
        outwards: per target joint of an upper arm the direction, (3,), out to the source's side, through which it is
            turned: so a target in A-pose is laid like the same in T-pose.
        hinges: per target joint of an upper arm or thigh its role, and the axis, (3,), about which a body that stands
            like the source, arms out, bends the limb: elbows forwards, knees backwards.
    """

    turn: Rotation
    outwards: dict[int, Array]
    hinges: dict[int, tuple[str, Array]]


def _bodies(matching: Matching, x: Array, y: Array) -> _Bodies:
    """Of the target, standing at `y`, (joints, 3), and the source, standing at `x`."""
    s, t = matching.anatomies
    if s is None or t is None:
        return _Bodies(Rotation.identity(), {}, {})
    theirs, ours = (
        squared(body_axes(anatomy, posture)) if is_pose(body, anatomy) else upright(body_axes(anatomy, posture))
        for body, anatomy, posture in ((matching.source, s, x), (matching.target, t, y))
    )
    turn = Rotation.identity() if _alike(matching) else Rotation.from_matrix(theirs @ ours.T)
    outwards: dict[int, Array] = {}
    hinges: dict[int, tuple[str, Array]] = {}
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        arm, thigh = (side + part for part in ("UpperArm", "UpperLeg"))
        outwards[t.roles.get(arm, -1)] = sign * theirs[:, 0]
        hinges[t.roles.get(arm, -1)] = arm, -sign * theirs[:, 1]
        hinges[t.roles.get(thigh, -1)] = thigh, theirs[:, 0]
    return _Bodies(turn, outwards, hinges)


def _built(matching: Matching, framed: bool) -> set[int]:
    """The target's joints of trunk, shoulders, hands and feet, whose bones lie differently in every build.

    Where a body stands in a frame of its motion, `framed`, spine and hands are not among them: there they may be bent.
    """
    source, anatomy = matching.anatomies
    if anatomy is None or source is None:
        return set()
    hips = anatomy.roles.get("hips", 0)
    built = {joint for role, joint in anatomy.roles.items() if role.endswith(BUILT)} | {*matching.target.line(hips)}
    if not framed:
        built |= {joint for role, joint in anatomy.roles.items() if not role.endswith(LONG)}
        built |= {*anatomy.spine, *anatomy.neck}
    return built


def _ankles(matching: Matching) -> set[int]:
    """The target's ankles, which are laid as the body is and not as the leg."""
    anatomy = matching.anatomies[1]
    roles = anatomy.roles if anatomy and matching.anatomies[0] else {}
    return {roles[f"{side}Foot"] for side in SIDES if f"{side}Foot" in roles}


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
