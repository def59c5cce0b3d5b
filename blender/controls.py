# SPDX-License-Identifier: GPL-3.0-or-later
"""Solve for poses of a rig's controls that bring its joints to the poses of a motion.

Names do not matter: each control is rotated, then moved, in the rest pose, and the joints that follow show its purpose.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

from distretarget.errors import counted

from .keys import converted, poses_of, set_switch, without_action
from .rig import other_animation

TURN = Quaternion((0.8, 0.0, 0.6), 0.2).to_matrix().to_4x4()  # test rotation of controls: not about the bone's axis
SHIFT = 0.03  # test translation of controls [of the body]
SAME = 2e-4  # tolerance for joints that follow a control [of the body, and entries of rotation matrices]
NEAR = 1e-4  # a frame is solved when joints are as near as this [of the body]
BODY = 1700.0  # assumed size of the body in messages [mm]
ROUNDS = 8  # limit of the iterations per frame
BETTER = 0.98  # iterations end when the error of no joint is less than this times that before
UNCHANGED = 1e-6  # transforms this near to the identity get no keys


class Switch(NamedTuple):
    """A custom property that chooses between the FK and the IK controls of a limb."""

    bone: str
    name: str
    values: dict[str, float]  # "FK" and "IK"


class Limb(NamedTuple):
    """A limb of two bones with IK."""

    joints: list[str]  # root, middle and end
    # By name, the joints, by number, between which parts lie: the pole; or without one both bones of the IK chain. From
    # another bend than that of the goal, IK might change the lengths of these.
    parts: dict[str, tuple[int, int]]


class Rig:
    """An armature without an action, to set its controls and read its joints."""

    def __init__(self, armature: bpy.types.Object, joints: Sequence[str]) -> None:
        self.armature, self.bones = armature, armature.pose.bones
        self.joints = [bone.name for bone in self.bones if bone.name in joints]
        shaped = [bone for bone in self.bones if bone.custom_shape is not None]
        free = [bone for bone in self.bones if all(each.type == "IK" for each in bone.constraints)]
        self.controls = [bone.name for bone in shaped or free]
        self.read_rest()
        self.size = float(np.ptp([self.rest[joint].translation for joint in self.joints], axis=0).max()) or 1.0
        self.switches = [switch for each in self._properties() if (switch := self._switch(*each))]

    def read_rest(self) -> None:
        """Read the rest poses of bones, which may depend on the switches."""
        self.put(dict.fromkeys(self.bones.keys(), Matrix()))
        self.rest = {bone.name: bone.matrix.copy() for bone in self.bones}

    def put(self, transforms: dict[str, Matrix]) -> None:
        """Set the transforms of bones relative to their rest pose."""
        for name, transform in transforms.items():
            self.bones[name].matrix_basis = transform
        self.update()

    def update(self) -> None:
        self.armature.update_tag()
        bpy.context.view_layer.update()

    def turn_to(self, mode: str) -> None:
        """Set all switches to "FK" or "IK"."""
        for switch in self.switches:
            set_switch(self.bones[switch.bone], switch.name, switch.values[mode])
        self.read_rest()

    def _poses_with(self, transforms: dict[str, Matrix]) -> dict[str, Matrix]:
        """The poses of joints and controls while some controls have these transforms."""
        self.put(transforms)
        found = {name: self.bones[name].matrix.copy() for name in (*self.joints, *self.controls)}
        self.put(dict.fromkeys(transforms, Matrix()))
        return found

    def _differ(self, one: Matrix, other: Matrix) -> bool:
        apart = (one.translation - other.translation).length > SAME * self.size
        return apart or np.abs(np.array(one.to_3x3()) - np.array(other.to_3x3())).max() > SAME

    def turned(self, name: str) -> tuple[set[str], int]:
        """The joints that move rigidly with a control when it rotates, and the number of controls that move."""
        found, before = self._poses_with({name: TURN}), self.rest
        turn = found[name] @ before[name].inverted()
        moved = {each for each in found if self._differ(found[each], before[each])}
        rigid = {each for each in moved & {*self.joints} if not self._differ(found[each], turn @ before[each])}
        return rigid, len(moved & {*self.controls})

    def carried(self, name: str) -> set[str]:
        """The joints displaced like a control that moves towards the body, as limbs may be too short to move away."""
        centre = sum((self.rest[joint].translation for joint in self.joints), Vector()) / len(self.joints)
        shift = (centre - self.rest[name].translation).normalized() * SHIFT * self.size
        found = self._poses_with({name: Matrix.Translation(self.rest[name].to_3x3().inverted() @ shift)})
        shift = found[name].translation - self.rest[name].translation
        errors = {each: found[each].translation - self.rest[each].translation - shift for each in self.joints}
        return {joint for joint in self.joints if errors[joint].length < SAME * self.size}

    def starts_at(self, control: str, joint: str) -> bool:
        """Whether a control has its head at a joint."""
        return (self.rest[control].translation - self.rest[joint].translation).length < SAME * self.size

    def _iks(self) -> list[tuple[bpy.types.PoseBone, bpy.types.Constraint]]:
        found = [(bone, each) for bone in self.bones for each in bone.constraints if each.type == "IK"]
        return [(bone, each) for bone, each in found if not each.mute and each.subtarget in self.bones]

    def _properties(self) -> list[tuple[str, str]]:
        """The (bone, custom property) pairs that drive influences of constraints."""
        animation = self.armature.animation_data
        curves = [each for each in (animation.drivers if animation else []) if each.data_path.endswith("influence")]
        variables = [variable for curve in curves for variable in curve.driver.variables]
        paths = {each.data_path for variable in variables for each in variable.targets}
        names = [(bone, name, bpy.utils.escape_identifier(name)) for bone in self.bones for name, _ in bone.items()]
        return [(bone.name, name) for bone, name, path in names if f'{bone.path_from_id()}["{path}"]' in paths]

    def _switch(self, bone: str, name: str) -> Switch | None:
        """A property as a switch, or None: at one of its limits the controls of IK targets move more joints."""
        before, data = self.bones[bone][name], self.bones[bone].id_properties_ui(name).as_dict()
        lines = [[self.bones[each.subtarget], *self.bones[each.subtarget].parent_recursive] for _, each in self._iks()]
        controls = [next((each.name for each in line if each.name in self.controls), None) for line in lines]
        limits, counts = [float(data.get("min", 0.0)), min(float(data.get("max", 1.0)), 1.0)], []
        for value in limits:
            set_switch(self.bones[bone], name, value)
            rest, found = (self._poses_with(dict.fromkeys({*controls} - {None}, turn)) for turn in (Matrix(), TURN))
            counts.append(sum(self._differ(found[joint], rest[joint]) for joint in self.joints))
        set_switch(self.bones[bone], name, before)
        self.update()
        ik = int(counts[1] > counts[0])
        return Switch(bone, name, {"IK": limits[ik], "FK": limits[1 - ik]}) if counts[0] != counts[1] else None

    def limbs(self) -> list[Limb]:
        """The limbs whose IK is active now, and whose first bone or pole is a control."""
        found = []
        for bone, constraint in self._iks():
            chain = [bone, *bone.parent_recursive][: constraint.chain_count or None]
            control = constraint.pole_subtarget or chain[-1].name
            if len(chain) == 2 and control in self.controls and constraint.influence:
                positions = np.array([self.rest[joint].translation for joint in self.joints])
                ends = np.array([chain[-1].head, bone.head, bone.tail])
                distances = np.linalg.norm(ends[:, None] - positions, axis=2)
                if distances.min(axis=1).max() < 10 * SAME * self.size:
                    joints = [self.joints[each] for each in distances.argmin(axis=1)]
                    pole, bones = constraint.pole_subtarget, {chain[1].name: (0, 1), bone.name: (1, 2)}
                    found.append(Limb(joints, {pole: (0, 2)} if pole else bones))
        return found

    def errors(self, goal: dict[str, Matrix]) -> tuple[np.ndarray, np.ndarray]:
        """The errors of the joints' positions [of the body] and rotations [rad], (joints,) each."""
        poses = np.array([self.bones[joint].matrix.normalized() for joint in self.joints])
        goals = np.array([goal[joint] for joint in self.joints])
        chords = np.linalg.norm(poses[:, :3, :3] - goals[:, :3, :3], axis=(1, 2))
        distances = np.linalg.norm(poses[:, :3, 3] - goals[:, :3, 3], axis=1) / self.size
        return distances, 2 * np.arcsin(np.minimum(chords / 8**0.5, 1.0))


def driven_joints(rig: Rig) -> dict[str, str]:
    """The joint that each control drives, by control: the first of the joints that move rigidly with it.

    A joint that is a control drives itself. Of several controls of another joint, one that starts there is chosen, then
    the one that moves most joints, but the root of the rig, which moves all controls, only if there is no other.
    """
    rigid, moving = {}, {}
    for control in rig.controls:
        rigid[control], moving[control] = rig.turned(control)
    found = {}
    for joint in rig.joints:
        choice = [name for name in rigid if joint == next((each for each in rig.joints if each in rigid[name]), None)]
        choice = [name for name in choice if moving[name] < len(rig.controls)] or choice
        at = {name: joint != rig.joints[0] and rig.starts_at(name, joint) for name in choice}
        if joint in rigid:
            found[joint] = joint
        elif choice:
            found[max(choice, key=lambda name: (at[name], len(rigid[name]), moving[name]))] = joint
    return found


def tweaks(rig: Rig, taken: Sequence[str]) -> dict[str, str]:
    """The joint of each control that starts at it and moves the fewest others with it, if not taken, by control."""
    carried = {name: rig.carried(name) for name in rig.controls if name not in taken}
    found = {}
    for joint in rig.joints:
        choice = [name for name in carried if joint in carried[name] and name not in found]
        best = min(choice, key=lambda name: len(carried[name]), default=None)
        if best and rig.starts_at(best, joint):
            found[best] = joint
    return found


def _frame(limb: Limb, part: str, poses: dict[str, Matrix], across: Vector | None = None) -> Matrix:
    """The frame at the start of a part of a limb: its axes are along the part, across the plane of the limb (`across`
    if that is straight), and the third.
    """
    root, middle, end = (poses[joint].translation for joint in limb.joints)
    normal = (middle - root).cross(end - middle)
    if normal.length < NEAR * (end - root).length_squared:
        normal = across or (end - root).orthogonal()
    start, stop = ((root, middle, end)[each] for each in limb.parts[part])
    along, normal = (stop - start).normalized(), normal.normalized()
    axes = Matrix((along, normal, along.cross(normal))).transposed()
    return Matrix.Translation(start) @ axes.to_4x4()


class Solver:
    """Sets controls so that each brings the joint that it drives to its goal."""

    def __init__(self, rig: Rig, driven: dict[str, str], limbs: list[Limb]) -> None:
        self.rig, self.driven = rig, driven
        self.parts = {name: limb for limb in limbs if driven.keys().isdisjoint(limb.parts) for name in limb.parts}
        self.offsets = {name: rig.rest[joint].inverted() @ rig.rest[name] for name, joint in driven.items()}
        self.controls = sorted({*driven, *self.parts}, key=rig.bones.find)  # parents first

    def solve(self, goal: dict[str, Matrix]) -> None:
        """Bring the joints to their goals in a frame, as far as these controls can."""
        rig, last = self.rig, math.inf
        poses = {name: goal[joint] @ self.offsets[name] for name, joint in self.driven.items()}
        for name, limb in self.parts.items():
            before, joint = _frame(limb, name, rig.rest), limb.joints[0]
            across = (goal[joint] @ rig.rest[joint].inverted()).to_3x3() @ before.to_3x3().col[1]
            poses[name] = _frame(limb, name, goal, across) @ before.inverted() @ rig.rest[name]
        for _ in range(ROUNDS):
            error = np.maximum(rig.errors(goal), NEAR)
            if error.max() == NEAR or (error > BETTER * last).all():
                break
            last = error
            before, after = {}, {}
            for name in self.controls:
                bone = rig.bones[name]
                parent = bone.parent.matrix if bone.parent else None
                moved = next((each.name for each in bone.parent_recursive if each.name in after), None)
                if moved is not None:
                    parent = after[moved] @ before[moved].inverted() @ parent
                before[name], after[name] = bone.matrix.copy(), poses[name]
                location, rotation, _ = converted(bone, after[name], parent, invert=True).decompose()
                bone.matrix_basis = Matrix.LocRotScale(location, rotation, None)
            rig.update()


def solve(
    armature: bpy.types.Object,
    names: Sequence[str],
    matrices: np.ndarray,
    mode: str,
    progress: Callable[[float], object],
) -> dict[str, Any]:
    """Return the "transforms" of FK and IK controls, (frames, 4, 4), by control; the "switches" that select `mode`,
    "FK" or "IK", as (bone, property, value); and warning "lines" on joints that cannot follow.

    `matrices` of joints with these `names` are as in `poses_of`. The other mode is solved first, so that the animator
    can switch to it; then `mode`, whose errors are measured. `progress` is called with the number of finished frames.
    """
    without_action(armature)
    for _, track in other_animation(armature, ()).values():
        track.mute = True
    (poses, _), bones = poses_of(armature, names, matrices), armature.data.bones
    rig = Rig(armature, [name for name in poses if name in names and bones[name].use_deform] or names)
    goals = [{name: poses[name][frame] for name in rig.joints} for frame in range(len(matrices))]
    transforms = {name: np.tile(np.eye(4), (len(matrices), 1, 1)) for name in rig.controls}
    others = ["IK" if mode == "FK" else "FK"] if rig.switches else []
    for each in [*others, mode]:
        rig.turn_to(each)
        driven, limbs = driven_joints(rig), rig.limbs() if each == "IK" or not rig.switches else []
        solvers, errors = [Solver(rig, driven, limbs)], []
        if each == mode:
            solvers.append(Solver(rig, driven | tweaks(rig, solvers[0].controls), limbs))
        for name in solvers[-1].controls:
            transforms.setdefault(name, np.tile(np.eye(4), (len(matrices), 1, 1)))
        fixed = transforms.keys() - solvers[-1].controls
        for frame, goal in enumerate(goals):
            rig.put({name: Matrix(transforms[name][frame]) for name in fixed})
            for solver in solvers:
                solver.solve(goal)
            for name in transforms:
                transforms[name][frame] = rig.bones[name].matrix_basis
            errors.append(rig.errors(goal))
            progress(1 / (1 + len(others)))
    distances, angles = (np.array(each) for each in zip(*errors, strict=True))
    return {
        "transforms": {name: each for name, each in transforms.items() if np.abs(each - np.eye(4)).max() > UNCHANGED},
        "switches": [(each.bone, each.name, each.values[mode]) for each in rig.switches],
        "lines": [
            *_lines(rig.joints, distances * BODY, 1.0, "mm on a body of 1.7 m"),
            *_lines(rig.joints, np.degrees(angles), 2.0, "degrees"),
        ],
    }


def _lines(joints: list[str], errors: np.ndarray, limit: float, words: str) -> list[str]:
    """A line on joints whose errors, (frames, joints), exceed a limit in any frame, if there are any."""
    worst = errors.max(axis=0)
    names = [joints[index] for index in np.argsort(-worst) if worst[index] > limit]
    more = f" and {counted(len(names) - 1, 'more bone')} are" if len(names) > 1 else " is"
    return [f"{names[0]!r}{more} off by up to {worst.max():.1f} {words}: no control prevents that"] if names else []
