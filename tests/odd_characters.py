"""Make characters that importers trip over, as .blend, with the true places of their joints.

    python tests/odd_characters.py FOLDER NAME...

Needs the package bpy. A character is the basic human of the add-on Rigify, with a box as mesh for each bone. NAME.npz
has `names`, (joints,), and `rest`, (joints, 3), in metres with Y up, as in glTF.
"""

import math
import sys
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

# Rigify's names without sides, and other names for the same bones; {} is the side.
PARTS = (
    "spine,spine.001,spine.002,spine.003,spine.004,spine.005,spine.006,"
    "shoulder,upper_arm,forearm,hand,thigh,shin,foot,toe"
)
UNITY = (
    "Hips,Spine,Chest,Upper Chest,Neck,Neck 2,Head,"
    "{} Shoulder,{} Upper Arm,{} Lower Arm,{} Hand,{} Upper Leg,{} Lower Leg,{} Foot,{} Toes"
)
ODD = UNITY.replace("Upper Chest", "Brust/Oberkörper").replace("Head", "頭").replace("{} Hand", "{}:Hand.x")
NO_BONES = ("breast", "pelvis", "heel")  # parts of Rigify's human that other characters lack


def human() -> bpy.types.Object:
    """An empty scene with Rigify's basic human and a box for each bone."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="rigify")
    bpy.ops.object.armature_basic_human_metarig_add()
    armature = bpy.context.object
    armature.name = armature.data.name = "Armature"
    spare = [bone.name for bone in armature.data.bones if bone.name.startswith(NO_BONES)]
    with_edit_bones(armature, lambda bones: [bones.remove(bones[name]) for name in spare])
    return armature


def with_edit_bones(armature: bpy.types.Object, change: Callable[[bpy.types.bpy_prop_collection], object]) -> None:
    """Change bones in edit mode."""
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    change(armature.data.edit_bones)
    bpy.ops.object.mode_set(mode="OBJECT")


def add_boxes(armature: bpy.types.Object, skinned: bool = True) -> None:
    """Give each deforming bone a box: in one mesh that the armature deforms, or as meshes that hang on the bones."""
    corners, faces, groups = [], [], {}
    square = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    for bone in (each for each in armature.data.bones if each.use_deform):
        first, width = len(corners), bone.length * 0.15
        ends = [Vector((x * width, y, z * width)) for y in (0.02 * bone.length, 0.9 * bone.length) for x, z in square]
        corners += [bone.matrix_local @ each for each in ends]
        box = [(0, 1, 2, 3), (7, 6, 5, 4), *((i, i + 4, (i + 1) % 4 + 4, (i + 1) % 4) for i in range(4))]
        faces += [tuple(first + corner for corner in face) for face in box]
        groups[bone.name] = range(first, first + 8)
        if not skinned:
            hang(armature, bone.name, ends, box)
    if skinned:
        body = new_mesh("Body", corners, faces)
        body.parent = armature
        for name, numbers in groups.items():
            body.vertex_groups.new(name=name).add(list(numbers), 1.0, "REPLACE")
        body.modifiers.new("Armature", "ARMATURE").object = armature


def new_mesh(name: str, corners: list[Vector], faces: list[tuple[int, ...]]) -> bpy.types.Object:
    """A new mesh in the scene."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    made = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


def hang(armature: bpy.types.Object, bone: str, corners: list[Vector], faces: list[tuple[int, ...]]) -> None:
    """A mesh whose parent is a bone."""
    part = new_mesh(f"Part {bone}", corners, faces)
    part.parent, part.parent_type, part.parent_bone = armature, "BONE", bone
    part.matrix_parent_inverse = Matrix.Translation((0, -armature.data.bones[bone].length, 0))


def rename(armature: bpy.types.Object, names: str, prefix: str = "") -> None:
    """Give the bones other names."""
    by_part = dict(zip(PARTS.split(","), names.split(","), strict=True))
    for bone in armature.data.bones:
        part = bone.name.removesuffix(".L").removesuffix(".R")
        bone.name = prefix + by_part[part].format("Right" if bone.name.endswith(".R") else "Left")


def names_with_spaces() -> None:
    """Names as in Unity's humanoid: Left Upper Arm."""
    armature = human()
    rename(armature, UNITY)
    add_boxes(armature)


def odd_names() -> None:
    """Colons, slashes, dots and other alphabets in names."""
    armature = human()
    rename(armature, ODD, "rig:")
    add_boxes(armature)


def scale_001() -> None:
    """An armature in centimetres with Y up, below an object with scale 0.01, turned by 90 degrees."""
    armature = human()
    turn = Matrix.Rotation(math.radians(90), 4, "X") @ Matrix.Scale(0.01, 4)
    armature.data.transform(turn.inverted())
    armature.matrix_world = turn
    add_boxes(armature)


def scale_uneven() -> None:
    """An armature below an object that is 10 % taller than wide."""
    armature = human()
    armature.scale = (1, 1, 1.1)
    add_boxes(armature)


def ik() -> None:
    """IK of arms and legs, with targets that count as deforming but move no mesh, as Blender makes bones."""
    armature = human()
    add_boxes(armature)
    limbs = [(bone, f"{end}{side}") for bone, end in (("forearm", "hand"), ("shin", "foot")) for side in (".L", ".R")]

    def add(bones: bpy.types.bpy_prop_collection) -> None:
        for _, end in limbs:
            bone = bones.new(f"{end[:-2]}_ik{end[-2:]}")
            bone.head, bone.tail, bone.roll = bones[end].head, bones[end].tail, bones[end].roll

    with_edit_bones(armature, add)
    for bone, end in limbs:
        constraint = armature.pose.bones[bone + end[-2:]].constraints.new("IK")
        constraint.target, constraint.subtarget = armature, f"{end[:-2]}_ik{end[-2:]}"
        constraint.chain_count = 2


def constraints() -> None:
    """A hand held to the head, a limited foot, IK from a toe up to the root; bones that are locked or scaled."""
    armature = human()
    add_boxes(armature)
    for name, kind, target in (("hand.L", "CHILD_OF", "spine.006"), ("toe.L", "IK", "hand.R")):
        constraint = armature.pose.bones[name].constraints.new(kind)
        constraint.target, constraint.subtarget = armature, target
    limits = armature.pose.bones["foot.L"].constraints.new("LIMIT_ROTATION")
    limits.use_limit_x = limits.use_limit_y = limits.use_limit_z = True
    limits.owner_space = "LOCAL"
    for bone in armature.pose.bones:
        bone.lock_location = bone.lock_rotation = (True, True, True)
    armature.data.bones["forearm.L"].use_local_location = False
    armature.pose.bones["spine"].rotation_mode = "AXIS_ANGLE"
    armature.pose.bones["spine"].scale = (2, 2, 2)


def hidden() -> None:
    """The armature is hidden in viewports."""
    armature = human()
    add_boxes(armature)
    armature.hide_viewport = True


def no_inherited_rotation() -> None:
    """Upper arms and head keep their direction when the trunk turns; hands do not inherit scale."""
    armature = human()
    add_boxes(armature)
    for name in ("upper_arm.L", "upper_arm.R", "spine.006"):
        armature.data.bones[name].use_inherit_rotation = False
    for name in ("hand.L", "hand.R"):
        armature.data.bones[name].inherit_scale = "NONE"


def drivers() -> None:
    """The left forearm bends with the right one, by a driver."""
    armature = human()
    add_boxes(armature)
    for bone in armature.pose.bones:
        bone.rotation_mode = "XYZ"
    driver = armature.pose.bones["forearm.L"].driver_add("rotation_euler", 0).driver
    variable = driver.variables.new()
    variable.type, variable.name = "TRANSFORMS", "angle"
    target = variable.targets[0]
    target.id, target.bone_target = armature, "forearm.R"
    target.transform_type, target.transform_space = "ROT_X", "LOCAL_SPACE"
    driver.expression = "angle + 0.3"


def two_armatures() -> None:
    """The character, and a crane for the camera, which moves no mesh."""
    add_boxes(human())
    crane = bpy.data.objects.new("Crane", bpy.data.armatures.new("Crane"))
    bpy.context.scene.collection.objects.link(crane)
    with_edit_bones(crane, lambda bones: setattr(bones.new("arm"), "tail", (0, 0, 3)))


def two_characters() -> None:
    """Two armatures with a skinned mesh each, so that somebody has to choose."""
    armature = human()
    add_boxes(armature)
    mesh = bpy.data.objects["Body"]
    for one in (armature, mesh):
        twin = one.copy()
        twin.data = one.data.copy()
        twin.name = f"{one.name} 2"
        bpy.context.scene.collection.objects.link(twin)
    bpy.data.objects["Armature 2"].location.x = 2
    bpy.data.objects["Body 2"].parent = bpy.data.objects["Armature 2"]
    bpy.data.objects["Body 2"].modifiers["Armature"].object = bpy.data.objects["Armature 2"]


def two_roots() -> None:
    """The body, and a lantern beside it, without a common root."""
    armature = human()

    def add(bones: bpy.types.bpy_prop_collection) -> None:
        bone = bones.new("lantern")
        bone.head, bone.tail = (1, 0, 1), (1, 0, 1.3)

    with_edit_bones(armature, add)
    add_boxes(armature)


def meshes_on_bones() -> None:
    """A robot: every part is a mesh that hangs on a bone, and nothing is skinned."""
    add_boxes(human(), skinned=False)


def posed() -> None:
    """A pose in the file that is not the bind pose: the nodes of the .glb show the pose."""
    armature = human()
    add_boxes(armature)
    for number, bone in enumerate(armature.pose.bones):
        bone.rotation_mode = "QUATERNION"
        bone.rotation_quaternion = Euler((0.3 * math.sin(number), 0.2 * math.cos(number), 0.1)).to_quaternion()


def rigify() -> None:
    """The rig that Rigify generates from its human, with 706 bones, of which 160 deform."""
    human()
    bpy.ops.object.armature_human_metarig_add()
    bpy.ops.pose.rigify_generate()
    add_boxes(bpy.context.object)
    for name in ("Armature", "metarig"):
        bpy.data.objects.remove(bpy.data.objects[name])


def places(armature: bpy.types.Object) -> np.ndarray:
    """(bones, 3), the heads of the evaluated bones in the world, with Y up."""
    shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
    heads = np.array([shown.matrix_world @ bone.head for bone in shown.pose.bones])
    return heads[:, [0, 2, 1]] * (1, 1, -1)


def save(folder: Path, name: str) -> None:
    """Save the scene, with the true places of the joints of each armature."""
    armatures = [each for each in bpy.context.scene.objects if each.type == "ARMATURE"]
    for armature in armatures:
        armature.data.pose_position = "REST"
        bpy.context.view_layer.update()
        mine = name if armature == armatures[0] else f"{name}.{armature.name}"
        np.savez(folder / f"{mine}.npz", names=armature.data.bones.keys(), rest=places(armature))
        armature.data.pose_position = "POSE"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / f"{name}.blend"))


if __name__ == "__main__":
    for chosen in sys.argv[2:]:
        globals()[chosen]()
        save(Path(sys.argv[1]).resolve(), chosen)
