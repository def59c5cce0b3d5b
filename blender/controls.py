# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses of the controls of a rig with which its joints lie where a motion has them.

Nothing is known of names: each control is turned, then moved, in the rest pose, and what follows tells what it is for.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

from .keys import converted, poses_of, without_action
from .rig import others_on

TURN = Quaternion((0.8, 0.0, 0.6), 0.2).to_matrix().to_4x4()  # by which controls are tried: not along the bone
SHIFT = 0.03  # by which they are tried [of the body]
SAME = 2e-4  # what follows does so up to this [of the body, and of rotation matrices]
NEAR = 1e-4  # a frame is solved when joints are as near as this [of the body]
BODY = 1700.0  # the body, when it is told how far off bones are [mm]
ROUNDS = 8  # evaluations of the rig for a frame, at most
BETTER = 0.98  # another one has to leave less than this of the error
ALIKE = 1e-6  # transforms up to this from none get no keys


class Switch(NamedTuple):
    """A custom property that chooses between the FK and the IK controls of a limb."""

    bone: str
    name: str
    values: dict[str, float]  # "FK" and "IK"


class Swivel(NamedTuple):
    """The control that turns a limb with IK about the line from its root to its end: a pole, or the first bone."""

    control: str
    middle: str  # bone of the IK chain at the knee or elbow
    joints: list[str]  # at the root, the middle and the end


class Rig:
    """An armature without action, whose controls are set and whose joints are looked at."""

    def __init__(self, armature: bpy.types.Object, joints: Sequence[str]) -> None:
        self.armature, self.bones = armature, armature.pose.bones
        self.joints = [bone.name for bone in self.bones if bone.name in joints]
        shaped = [bone for bone in self.bones if bone.custom_shape is not None]
        free = [bone for bone in self.bones if all(each.type == "IK" for each in bone.constraints)]
        self.controls = [bone.name for bone in shaped or free]
        self.look()
        self.size = float(np.ptp([pose.translation for pose in self.rest.values()], axis=0).max()) or 1.0
        self.switches = [switch for each in self._properties() if (switch := self._switch(*each))]

    def look(self) -> None:
        """Take the rest pose as it is with the switches as they are."""
        self.put(dict.fromkeys(self.bones.keys(), Matrix()))
        self.rest, self.own = self.poses(self.joints), self.poses(self.controls)

    def put(self, transforms: dict[str, Matrix]) -> None:
        """Give bones their own transforms."""
        for name, transform in transforms.items():
            self.bones[name].matrix_basis = transform
        self.update()

    def update(self) -> None:
        self.armature.update_tag()
        bpy.context.view_layer.update()

    def poses(self, names: Sequence[str]) -> dict[str, Matrix]:
        return {name: self.bones[name].matrix.copy() for name in names}

    def turn_to(self, mode: str) -> None:
        """Set all switches to "FK" or "IK"."""
        for switch in self.switches:
            self._set(switch.bone, switch.name, switch.values[mode])
        self.look()

    def _set(self, bone: str, name: str, value: float) -> None:
        self.bones[bone][name] = type(self.bones[bone][name])(value)

    def set_pose(self, name: str, pose: Matrix, parent: Matrix | None) -> None:
        """Give a bone the location and rotation with which it has a pose, where its parent has one."""
        place, turn, _ = converted(self.bones[name], pose, parent, invert=True).decompose()
        self.bones[name].matrix_basis = Matrix.LocRotScale(place, turn, None)

    def _tried(self, transforms: dict[str, Matrix]) -> dict[str, Matrix]:
        """The poses of joints and controls while some controls have other transforms."""
        self.put(transforms)
        found = self.poses([*self.joints, *self.controls])
        self.put(dict.fromkeys(transforms, Matrix()))
        return found

    def _differ(self, one: Matrix, other: Matrix) -> bool:
        away = (one.translation - other.translation).length > SAME * self.size
        return away or np.abs(np.array(one.to_3x3()) - np.array(other.to_3x3())).max() > SAME

    def turned(self, name: str) -> tuple[set[str], int]:
        """The joints that turn with a control as if it held them, and how many controls move with it."""
        found, before = self._tried({name: TURN}), self.rest | self.own
        turn = found[name] @ self.own[name].inverted()
        moved = {each for each in before if self._differ(found[each], before[each])}
        held = {each for each in moved & {*self.joints} if not self._differ(found[each], turn @ before[each])}
        return held, len(moved & {*self.controls})

    def carried(self, name: str) -> set[str]:
        """The joints whose place moves with that of a control, towards the body: straight limbs reach no farther."""
        middle = sum((pose.translation for pose in self.rest.values()), Vector()) / len(self.rest)
        way = (middle - self.own[name].translation).normalized() * SHIFT * self.size
        found = self._tried({name: Matrix.Translation(self.own[name].to_3x3().inverted() @ way)})
        way = found[name].translation - self.own[name].translation
        off = {each: found[each].translation - self.rest[each].translation - way for each in self.joints}
        return {joint for joint in self.joints if off[joint].length < SAME * self.size}

    def starts_at(self, control: str, joint: str) -> bool:
        """Whether a control has its head at a joint."""
        return (self.own[control].translation - self.rest[joint].translation).length < SAME * self.size

    def _iks(self) -> list[tuple[bpy.types.PoseBone, bpy.types.Constraint]]:
        found = [(bone, each) for bone in self.bones for each in bone.constraints if each.type == "IK"]
        return [(bone, each) for bone, each in found if not each.mute and each.subtarget in self.bones]

    def _properties(self) -> list[tuple[str, str]]:
        """Bones and their custom properties that drive influences of constraints."""
        animation = self.armature.animation_data
        curves = [each for each in (animation.drivers if animation else []) if each.data_path.endswith("influence")]
        variables = [variable for curve in curves for variable in curve.driver.variables]
        paths = dict.fromkeys(each.data_path for variable in variables for each in variable.targets)
        ends = {bone.path_from_id(): bone for bone in self.bones}
        found = [(ends.get(head), name.strip("\"']")) for head, _, name in (path.rpartition("[") for path in paths)]
        return [(bone.name, name) for bone, name in found if bone and name in bone]

    def _switch(self, bone: str, name: str) -> Switch | None:
        """A property as a switch, if more joints move with the targets of IK at one of its ends than at the other."""
        before, ends = self.bones[bone][name], self.bones[bone].id_properties_ui(name).as_dict()
        lines = [[self.bones[each.subtarget], *self.bones[each.subtarget].parent_recursive] for _, each in self._iks()]
        controls = [next((each.name for each in line if each.name in self.controls), None) for line in lines]
        limits, counts = [float(ends.get("min", 0.0)), min(float(ends.get("max", 1.0)), 1.0)], []
        for value in limits:
            self._set(bone, name, value)
            still, found = (self._tried(dict.fromkeys({*controls} - {None}, turn)) for turn in (Matrix(), TURN))
            counts.append(sum(self._differ(found[joint], still[joint]) for joint in self.joints))
        self._set(bone, name, before)
        self.update()
        ik = int(counts[1] > counts[0])
        return Switch(bone, name, {"IK": limits[ik], "FK": limits[1 - ik]}) if counts[0] != counts[1] else None

    def swivels(self) -> list[Swivel]:
        """What turns each limb that has IK now."""
        found = []
        for bone, constraint in self._iks():
            chain = [bone, *bone.parent_recursive][: constraint.chain_count or None]
            control = constraint.pole_subtarget or chain[-1].name
            if len(chain) == 2 and control in self.controls and constraint.influence:
                places = np.array([self.rest[joint].translation for joint in self.joints])
                ends = np.array([chain[-1].head, bone.head, bone.tail])
                away = np.linalg.norm(ends[:, None] - places, axis=2)
                if away.min(axis=1).max() < 10 * SAME * self.size:
                    found.append(Swivel(control, bone.name, [self.joints[each] for each in away.argmin(axis=1)]))
        return found

    def off(self, goal: dict[str, Matrix]) -> tuple[np.ndarray, np.ndarray]:
        """How far joints are from where they should be [of the body], and how far turned [rad]."""
        is_ = np.array([self.bones[joint].matrix.normalized() for joint in self.joints])
        shall = np.array([goal[joint] for joint in self.joints])
        chords = np.linalg.norm(is_[:, :3, :3] - shall[:, :3, :3], axis=(1, 2))
        places = np.linalg.norm(is_[:, :3, 3] - shall[:, :3, 3], axis=1) / self.size
        return places, 2 * np.arcsin(np.minimum(chords / 8**0.5, 1.0))


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
        self.holds = dict(sorted(holds.items(), key=lambda each: rig.bones.find(each[0])))
        self.offsets = {name: rig.rest[joint].inverted() @ rig.own[name] for name, joint in holds.items()}
        self.controls = {*holds, *(each.control for each in self.swivels)}

    def solve(self, goal: dict[str, Matrix]) -> None:
        """Bring the joints of a frame to where they should be, as far as these controls can."""
        rig, last = self.rig, math.inf
        for _ in range(ROUNDS):
            left = np.max(rig.off(goal))
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
        parent = bone.parent.matrix if bone.parent else None
        before = converted(bone, bone.matrix_basis, parent, invert=False)  # without its constraints
        self.rig.set_pose(swivel.control, turn @ before, parent)


def solve(
    armature: bpy.types.Object,
    names: Sequence[str],
    matrices: np.ndarray,
    mode: str,
    progress: Callable[[float], object],
) -> dict[str, Any]:
    """Return the "transforms" of the controls of "FK" or "IK", and of the other mode's, ready when it is switched.

    They are (frames, 4, 4), by control; "switches" are a bone, a property and its value each, and "lines" say what
    cannot follow. `matrices` of joints with these names are as in `poses_of`. The mode asked for comes last, over all
    that the other has moved, and is what is measured. `progress` is called with the number of frames that are done.
    """
    without_action(armature)
    for _, track in others_on(armature, ()):
        track.mute = True
    (poses, _), bones = poses_of(armature, names, matrices), armature.data.bones
    rig = Rig(armature, [name for name in poses if name in names and bones[name].use_deform] or names)
    goals = [{name: poses[name][frame] for name in rig.joints} for frame in range(len(matrices))]
    transforms = {name: np.tile(np.eye(4), (len(matrices), 1, 1)) for name in rig.controls}
    others = ["IK" if mode == "FK" else "FK"] if rig.switches else []
    for each in [*others, mode]:
        rig.turn_to(each)
        holds, swivels = holders(rig), rig.swivels() if each == "IK" or not rig.switches else []
        solvers, measured = [Solver(rig, holds, swivels)], []
        if each == mode:
            fine = tweaks(rig, {*holds, *(one.control for one in swivels)})
            solvers.append(Solver(rig, holds | fine, swivels))
        kept = transforms.keys() - solvers[-1].controls
        for frame, goal in enumerate(goals):
            rig.put({name: Matrix(transforms[name][frame]) for name in kept})
            for solver in solvers:
                solver.solve(goal)
            for name in transforms:
                transforms[name][frame] = rig.bones[name].matrix_basis
            measured.append(rig.off(goal))
            progress(1 / (1 + len(others)))
    places, turns = (np.array(each) for each in zip(*measured, strict=True))
    return {
        "transforms": {name: each for name, each in transforms.items() if np.abs(each - np.eye(4)).max() > ALIKE},
        "switches": [(each.bone, each.name, each.values[mode]) for each in rig.switches],
        "lines": [
            *_lines(rig.joints, places * BODY, 1.0, "mm on a body of 1.7 m from where they should be"),
            *_lines(rig.joints, np.degrees(turns), 2.0, "degrees turned from where they should be"),
        ],
    }


def _lines(joints: list[str], off: np.ndarray, limit: float, words: str) -> list[str]:
    """A line on what cannot follow, if joints are off by more than a limit in any frame; `off` is (frames, joints)."""
    worst = off.max(axis=0)
    names = [joints[index] for index in np.argsort(-worst) if worst[index] > limit]
    more = f" and {len(names) - 1} more bones are" if len(names) > 1 else " is"
    return [f"{names[0]!r}{more} up to {worst.max():.1f} {words}: no control moves them so"] if names else []
