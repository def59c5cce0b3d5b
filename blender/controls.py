# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses of the controls of a rig with which its joints lie where a motion has them.

Nothing is known of names: each control is turned, then moved, in the rest pose, and what follows tells what it is for.
"""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

from .keys import Result, converted, poses_of, without_action
from .rig import others_on

TURN = Quaternion((0.8, 0.0, 0.6), 0.2).to_matrix().to_4x4()  # by which controls are tried: not along the bone
SHIFT = 0.03  # by which they are tried [of the body]
SAME = 2e-4  # what follows does so up to this [of the body, and of rotation matrices]
NEAR = 1e-4  # a frame is solved when joints are as near as this [of the body]
BODY = 1700.0  # the body, when it is told how far off bones are [mm]
ROUNDS = 8  # evaluations of the rig for a frame, at most
BETTER = 0.98  # another one has to leave less than this of the error


@dataclass(frozen=True)
class Switch:
    """A custom property that chooses between the FK and the IK controls of a limb."""

    bone: str
    name: str
    values: dict[str, float]  # "FK" and "IK"


@dataclass(frozen=True)
class Swivel:
    """The control that turns a limb with IK about the line from its root to its end: a pole, or the first bone."""

    control: str
    middle: str  # bone of the IK chain at the knee or elbow
    joints: tuple[str, str, str]  # at the root, the middle and the end


class Rig:
    """An armature without action, whose controls are set and whose joints are looked at."""

    def __init__(self, armature: bpy.types.Object, joints: list[str]) -> None:
        self.armature, self.bones = armature, armature.pose.bones
        self.joints = [bone.name for bone in self.bones if bone.name in joints]
        shaped = [bone for bone in self.bones if bone.custom_shape is not None]
        free = [bone for bone in self.bones if all(each.type == "IK" for each in bone.constraints)]
        self.controls = [bone.name for bone in shaped or free]
        self.look()
        places = np.array([[*pose.translation] for pose in self.rest.values()])
        self.size = float(np.ptp(places, axis=0).max()) or 1.0
        self.switches = [switch for each in self._properties() if (switch := self._switch(*each))]

    def clear(self) -> None:
        """Put all bones into the rest pose."""
        for bone in self.bones:
            bone.matrix_basis = Matrix()
        self.update()

    def look(self) -> None:
        """Take the rest pose as it is with the switches as they are."""
        self.clear()
        self.rest, self.own = self.poses(self.joints), self.poses(self.controls)

    def update(self) -> None:
        self.armature.update_tag()
        bpy.context.view_layer.update()

    def poses(self, names: list[str]) -> dict[str, Matrix]:
        return {name: self.bones[name].matrix.copy() for name in names}

    def turn_to(self, mode: str) -> None:
        """Set all switches to "FK" or "IK"."""
        for switch in self.switches:
            _set(self.bones[switch.bone], switch.name, switch.values[mode])
        self.look()

    def set_pose(self, name: str, pose: Matrix, parent: Matrix | None) -> None:
        """Give a bone the location and rotation with which it has a pose, where its parent has one."""
        place, turn, _ = converted(self.bones[name], pose, parent, invert=True).decompose()
        self.bones[name].matrix_basis = Matrix.LocRotScale(place, turn, None)

    def given_pose(self, name: str) -> Matrix:
        """The pose of a bone by its own transform, before constraints."""
        bone = self.bones[name]
        return converted(bone, bone.matrix_basis, bone.parent.matrix if bone.parent else None, invert=False)

    def _tried(self, name: str, basis: Matrix) -> dict[str, Matrix]:
        """The joints, and the control itself, with another transform of a control."""
        self.bones[name].matrix_basis = basis
        self.update()
        found = self.poses([*self.joints, *self.controls])
        self.bones[name].matrix_basis = Matrix()
        return found

    def _differ(self, one: Matrix, other: Matrix) -> bool:
        away = (one.translation - other.translation).length > SAME * self.size
        return away or np.abs(np.array(one.to_3x3()) - np.array(other.to_3x3())).max() > SAME

    def turned(self, name: str) -> tuple[set[str], int]:
        """The joints that turn with a control as if it held them, and how many controls move with it."""
        found = self._tried(name, TURN)
        turn = found[name] @ self.own[name].inverted()
        before = self.rest | self.own
        moved = {each for each in before if self._differ(found[each], before[each])}
        held = {each for each in moved & {*self.joints} if not self._differ(found[each], turn @ before[each])}
        return held, len(moved & {*self.controls})

    def carried(self, name: str) -> set[str]:
        """The joints whose place moves with that of a control, towards the body: straight limbs reach no farther."""
        middle = sum((pose.translation for pose in self.rest.values()), Vector()) / len(self.rest)
        way = (middle - self.own[name].translation).normalized() * SHIFT * self.size
        found = self._tried(name, Matrix.Translation(self.own[name].to_3x3().inverted() @ way))
        way = found[name].translation - self.own[name].translation
        off = {each: found[each].translation - self.rest[each].translation - way for each in self.joints}
        return {joint for joint in self.joints if off[joint].length < SAME * self.size}

    def starts_at(self, control: str, joint: str) -> bool:
        """Whether a control has its head at a joint."""
        return (self.own[control].translation - self.rest[joint].translation).length < SAME * self.size

    def _iks(self) -> list[tuple[bpy.types.PoseBone, bpy.types.Constraint]]:
        found = [(bone, each) for bone in self.bones for each in bone.constraints if each.type == "IK"]
        return [(bone, each) for bone, each in found if not each.mute and each.subtarget in self.bones]

    def _control_of(self, name: str) -> str | None:
        """A control, or the one above a bone."""
        line = [name, *(bone.name for bone in self.bones[name].parent_recursive)]
        return next((each for each in line if each in self.controls), None)

    def _properties(self) -> list[tuple[str, str]]:
        """Bones and their custom properties that drive influences of constraints."""
        animation, found = self.armature.animation_data, {}
        for curve in animation.drivers if animation else []:
            if not curve.data_path.endswith("influence"):
                continue
            paths = [each.data_path for variable in curve.driver.variables for each in variable.targets]
            for bone, path in itertools.product(self.bones, paths):
                head, _, name = path.rpartition("[")
                if head == bone.path_from_id():
                    found[bone.name, name.strip("\"']")] = None
        return [(bone, name) for bone, name in found if name in self.bones[bone]]

    def _switch(self, bone: str, name: str) -> Switch | None:
        """A property as a switch, if more joints move with the targets of IK at one of its ends than at the other."""
        owner = self.bones[bone]
        before, ends, counts = owner[name], owner.id_properties_ui(name).as_dict(), []
        targets = {self._control_of(each.subtarget) for _, each in self._iks()} - {None}
        limits = [float(ends.get("min", 0.0)), min(float(ends.get("max", 1.0)), 1.0)]
        for value in limits:
            _set(owner, name, value)
            self.update()
            still = self.poses(self.joints)
            for each in targets:
                self.bones[each].matrix_basis = TURN
            self.update()
            found = self.poses(self.joints)
            counts.append(sum(self._differ(found[joint], still[joint]) for joint in self.joints))
            for each in targets:
                self.bones[each].matrix_basis = Matrix()
        _set(owner, name, before)
        self.update()
        if counts[0] == counts[1]:
            return None
        ik = int(counts[1] > counts[0])
        return Switch(bone, name, {"IK": limits[ik], "FK": limits[1 - ik]})

    def swivels(self) -> list[Swivel]:
        """What turns each limb that has IK now."""
        found = []
        for bone, constraint in self._iks():
            chain = [bone, *bone.parent_recursive][: constraint.chain_count or None]
            control = constraint.pole_subtarget or chain[-1].name
            if len(chain) != 2 or control not in self.controls or not constraint.influence:
                continue
            joints = [self._joint_at(place) for place in (chain[-1].head, bone.head, bone.tail)]
            if None not in joints:
                found.append(Swivel(control, bone.name, tuple(joints)))
        return found

    def _joint_at(self, place: Vector) -> str | None:
        distances = {joint: (self.rest[joint].translation - place).length for joint in self.joints}
        nearest = min(distances, key=distances.get)
        return nearest if distances[nearest] < 10 * SAME * self.size else None


def _set(bone: bpy.types.PoseBone, name: str, value: float) -> None:
    bone[name] = type(bone[name])(value)


def holders(rig: Rig) -> dict[str, str]:
    """The joint that each control holds, if any; where several hold it, the one that starts there and moves most.

    The first joint is held by what moves most of the body, but not by what moves all controls, which is the root.
    """
    held, moving = {}, {}
    for control in rig.controls:
        held[control], moving[control] = rig.turned(control)
    found = {}
    for joint in rig.joints:
        choice = [name for name in held if joint == next((each for each in rig.joints if each in held[name]), None)]
        choice = [name for name in choice if moving[name] < len(rig.controls)] or choice
        at = {name: joint != rig.joints[0] and rig.starts_at(name, joint) for name in choice}
        if joint in held:
            found[joint] = joint
        elif choice:
            found[max(choice, key=lambda name: (at[name], len(held[name]), moving[name]))] = joint
    return found


def tweaks(rig: Rig, taken: set[str]) -> dict[str, str]:
    """The control that moves the fewest other joints with a joint, of those that are not taken; by control."""
    carried = {name: rig.carried(name) for name in rig.controls if name not in taken}
    found = {}
    for joint in rig.joints:
        choice = [name for name in carried if joint in carried[name] and name not in found]
        best = min(choice, key=lambda name: len(carried[name]), default=None)
        if best and rig.starts_at(best, joint):
            found[best] = joint
    return found


class Solver:
    """Sets controls so that each holds its joint where it should be."""

    def __init__(self, rig: Rig, holds: dict[str, str], swivels: list[Swivel]) -> None:
        self.rig, self.swivels = rig, [each for each in swivels if each.control not in holds]
        order = [bone.name for bone in rig.bones]
        self.holds = dict(sorted(holds.items(), key=lambda each: order.index(each[0])))
        self.offsets = {name: rig.rest[joint].inverted() @ rig.own[name] for name, joint in holds.items()}

    @property
    def controls(self) -> list[str]:
        return [*self.holds, *(each.control for each in self.swivels)]

    def solve(self, goal: dict[str, Matrix]) -> None:
        """Bring the joints of a frame to where they should be, as far as these controls can."""
        rig, last = self.rig, math.inf
        for _ in range(ROUNDS):
            places, turns = off(rig, goal)
            left = max(places.max() / rig.size, turns.max())
            if left < NEAR or left > BETTER * last:
                break
            last = left
            before, after = {}, {}
            for name, joint in self.holds.items():
                bone = rig.bones[name]
                parent = bone.parent.matrix if bone.parent else None
                moved = next((each.name for each in bone.parent_recursive if each.name in after), None)
                if moved is not None:
                    parent = after[moved] @ before[moved].inverted() @ parent
                before[name], after[name] = bone.matrix.copy(), goal[joint] @ self.offsets[name]
                rig.set_pose(name, after[name], parent)
            rig.update()
            for each in self.swivels:
                self._swivel(each, goal)
            if self.swivels:
                rig.update()

    def _swivel(self, swivel: Swivel, goal: dict[str, Matrix]) -> None:
        """Turn a limb about the line from its root to its end."""
        root, middle, end = (goal[joint].translation for joint in swivel.joints)
        axis = (end - root).normalized()
        is_, shall = self.rig.bones[swivel.middle].head - root, middle - root
        is_, shall = is_ - is_.dot(axis) * axis, shall - shall.dot(axis) * axis
        if min(is_.length, shall.length) < NEAR * self.rig.size:
            return
        angle = math.atan2(axis.dot(is_.cross(shall)), is_.dot(shall))
        turn = Matrix.Translation(root) @ Matrix.Rotation(angle, 4, axis) @ Matrix.Translation(-root)
        bone = self.rig.bones[swivel.control]
        pose = turn @ self.rig.given_pose(swivel.control)
        self.rig.set_pose(swivel.control, pose, bone.parent.matrix if bone.parent else None)


def off(rig: Rig, goal: dict[str, Matrix]) -> tuple[np.ndarray, np.ndarray]:
    """How far joints are from where they should be [units of the armature], and how far turned [rad]."""
    is_ = np.array([rig.bones[joint].matrix.normalized() for joint in rig.joints])
    shall = np.array([goal[joint] for joint in rig.joints])
    chords = np.linalg.norm(is_[:, :3, :3] - shall[:, :3, :3], axis=(1, 2))
    return np.linalg.norm(is_[:, :3, 3] - shall[:, :3, 3], axis=1), 2 * np.arcsin(np.minimum(chords / 8**0.5, 1.0))


@dataclass(frozen=True)
class Solved:
    """Transforms of controls by frame, switches as they are to be set, and how far joints are off, (frames, joints)."""

    bases: dict[str, np.ndarray]  # (frames, 4, 4)
    switches: list[Switch]
    joints: list[str]
    places: np.ndarray  # of the body
    turns: np.ndarray  # [rad]


def solve(armature: bpy.types.Object, result: Result, mode: str, tell: Callable[[int], object]) -> Solved:
    """Return the transforms of the controls of "FK" or "IK", and of the other mode's, ready when it is switched.

    The mode asked for comes last, over all that the other has moved, and is what is measured. `tell` is called with
    the number of percent that are done since the last call.
    """
    without_action(armature)
    for _, track in others_on(armature, ()):
        track.mute = True
    bones, frames = armature.data.bones, len(result.matrices)
    poses = {name: poses for name, poses in poses_of(armature, result).items() if name in result.names}
    rig = Rig(armature, [name for name in poses if bones[name].use_deform] or [*poses])
    goals = [{name: poses[name][frame] for name in rig.joints} for frame in range(frames)]
    bases = {name: np.tile(np.eye(4), (frames, 1, 1)) for name in rig.controls}
    modes, done = [*(["IK" if mode == "FK" else "FK"] if rig.switches else []), mode], 0
    for each in modes:
        rig.turn_to(each)
        holds, swivels = holders(rig), rig.swivels() if each == "IK" or not rig.switches else []
        fine = tweaks(rig, {*holds, *(one.control for one in swivels)}) if each == mode else {}
        solvers = [Solver(rig, holds, swivels), Solver(rig, holds | fine, swivels)]
        rig.clear()
        measured = []
        for frame, goal in enumerate(goals):
            measured.append(_frame(rig, solvers[: 1 + (each == mode)], goal, bases, frame))
            done += 1
            tell(100 * done // (frames * len(modes)) - 100 * (done - 1) // (frames * len(modes)))
    places, turns = (np.array(each) for each in zip(*measured, strict=True))
    return Solved(bases, rig.switches, rig.joints, places / rig.size, turns)


def _frame(
    rig: Rig, solvers: list[Solver], goal: dict[str, Matrix], bases: dict[str, np.ndarray], frame: int
) -> tuple[np.ndarray, np.ndarray]:
    """Solve a frame, starting with the one before; keep the transforms, and return how far joints are off."""
    for name in bases.keys() - {*solvers[-1].controls}:
        rig.bones[name].matrix_basis = Matrix(bases[name][frame].tolist())
    rig.update()
    for solver in solvers:
        solver.solve(goal)
    for name in bases:
        bases[name][frame] = rig.bones[name].matrix_basis
    return off(rig, goal)


def lines_on(solved: Solved) -> list[str]:
    """A line on each kind of what cannot follow."""
    lines = []
    for values, limit, unit, word in (
        (solved.places * BODY, 1.0, "mm on a body of 1.7 m", "from where they should be"),
        (np.degrees(solved.turns), 2.0, "degrees", "turned from where they should be"),
    ):
        worst = values.max(axis=0)
        names = [solved.joints[index] for index in np.argsort(-worst) if worst[index] > limit]
        if names:
            more = f" and {len(names) - 1} more bones are" if len(names) > 1 else " is"
            lines.append(f"{names[0]!r}{more} up to {worst.max():.1f} {unit} {word}: no control moves them so")
    return lines
