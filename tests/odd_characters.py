"""Make characters that are hard to move, as .blend.

    python tests/odd_characters.py FOLDER NAME...

Needs the package bpy. A character is the basic human of the add-on Rigify, with a box as mesh for each bone.
"""

import math
import os
import sys
from collections.abc import Callable
from pathlib import Path

import bpy
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
UNREAL = (
    "pelvis,spine_01,spine_02,spine_03,neck_01,neck_02,head,"
    "clavicle_{},upperarm_{},lowerarm_{},hand_{},thigh_{},calf_{},foot_{},ball_{}"
)
VRM = (
    "J_Bip_C_Hips,J_Bip_C_Spine,J_Bip_C_Chest,J_Bip_C_UpperChest,J_Bip_C_Neck,J_Bip_C_Neck2,J_Bip_C_Head,"
    "J_Bip_{}_Shoulder,J_Bip_{}_UpperArm,J_Bip_{}_LowerArm,J_Bip_{}_Hand,"
    "J_Bip_{}_UpperLeg,J_Bip_{}_LowerLeg,J_Bip_{}_Foot,J_Bip_{}_ToeBase"
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


def rename(
    armature: bpy.types.Object, names: str, prefix: str = "", sides: tuple[str, str] = ("Left", "Right")
) -> None:
    """Give the bones other names."""
    by_part = dict(zip(PARTS.split(","), names.split(","), strict=True))
    for bone in armature.data.bones:
        part = bone.name.removesuffix(".L").removesuffix(".R")
        bone.name = prefix + by_part[part].format(sides[bone.name.endswith(".R")])


def add_bone(
    armature: bpy.types.Object, name: str, head: Vector, tail: Vector, parent: str | None = None, roll: float = 0.0
) -> None:
    """Add a bone."""

    def add(bones: bpy.types.bpy_prop_collection) -> None:
        bone = bones.new(name)
        bone.head, bone.tail, bone.roll = head, tail, roll
        bone.parent = bones[parent] if parent else None

    with_edit_bones(armature, add)


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


def unreal() -> None:
    """A root bone, twist bones that have skin, and IK bones that have none, as in Unreal."""
    armature = human()
    rename(armature, UNREAL, sides=("l", "r"))
    add_bone(armature, "root", Vector(), Vector((0, 0.2, 0)))
    with_edit_bones(armature, lambda bones: setattr(bones["pelvis"], "parent", bones["root"]))
    for name in ("upperarm_l", "upperarm_r", "lowerarm_l", "lowerarm_r", "calf_l", "calf_r"):
        bone = armature.data.bones[name]
        middle = (bone.head_local + bone.tail_local) / 2
        add_bone(armature, f"{name[:-2]}_twist_01{name[-2:]}", middle, bone.tail_local, name)
    add_boxes(armature)
    for end in ("foot_l", "foot_r", "hand_l", "hand_r"):
        bone = armature.data.bones[end]
        add_bone(armature, f"ik_{end}", bone.head_local, bone.tail_local, "root")


def vrm() -> None:
    """Names as of VRoid, a skirt of eight bones whose sway hangs from the hips, and a staff as a mesh on a hand."""
    armature = human()
    rename(armature, VRM, sides=("L", "R"))
    hips = armature.data.bones["J_Bip_C_Hips"].head_local.copy()
    for number in range(8):
        way = Matrix.Rotation(number * math.pi / 4, 3, "Z") @ Vector((0.2, 0, 0))
        top, end = hips + way, hips + 1.3 * way - Vector((0, 0, 0.2))
        add_bone(armature, f"J_Sec_Skirt{number}_01", top, end, "J_Bip_C_Hips")
        add_bone(armature, f"J_Sec_Skirt{number}_02", end, 2 * end - top, f"J_Sec_Skirt{number}_01")
    add_boxes(armature)
    hang(armature, "J_Bip_R_Hand", [Vector((0, 0, -0.5)), Vector((0, 0, 0.5)), Vector((0.02, 0, 0.5))], [(0, 1, 2)])


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
    for _, end in limbs:
        bone = armature.data.bones[end]
        add_bone(armature, f"{end[:-2]}_ik{end[-2:]}", bone.head_local, bone.tail_local)
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
    add_bone(armature, "lantern", Vector((1, 0, 1)), Vector((1, 0, 1.3)))
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
    """The rig that Rigify generates."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="rigify")
    bpy.ops.object.armature_basic_human_metarig_add()
    bpy.ops.pose.rigify_generate()


def copies() -> None:
    """Deforming bones copy FK bones, or IK bones with poles by a property of the targets."""
    rig = human()
    rig.name = "rig"
    deforming = [bone.name for bone in rig.data.bones]
    limbs = [
        (one + side, two + side, end + side)
        for side in (".L", ".R")
        for one, two, end in (("upper_arm", "forearm", "hand"), ("thigh", "shin", "foot"))
    ]
    with_edit_bones(rig, lambda bones: _add_controls(bones, deforming, limbs))
    poses, shape = rig.pose.bones, bpy.data.objects.new("shape", None)

    def copy(name: str, source: str, driver: str = "") -> None:
        constraint = poses[name].constraints.new("COPY_TRANSFORMS")
        constraint.target, constraint.subtarget = rig, source
        if driver:
            curve = constraint.driver_add("influence")
            target = curve.driver.variables.new().targets[0]
            target.id, target.data_path = rig, f'pose.bones["{driver}"]["ik"]'
            curve.driver.type = "AVERAGE"

    for name in deforming:
        copy(name, "fk " + name)
    for one, two, end in limbs:
        poses["target " + end]["ik"] = 0.0
        copy(one, "ik " + one, "target " + end)
        copy(two, "ik " + two, "target " + end)
        copy(end, "target " + end, "target " + end)
        ik = poses["ik " + two].constraints.new("IK")
        ik.target = ik.pole_target = rig
        ik.subtarget, ik.pole_subtarget, ik.chain_count = "target " + end, "pole " + end, 2

        def away(degrees: int, ik: bpy.types.Constraint = ik, two: str = two) -> float:
            ik.pole_angle = math.radians(degrees)
            bpy.context.view_layer.update()
            return (poses["ik " + two].head - rig.data.bones[two].head_local).length

        ik.pole_angle = math.radians(min(range(-180, 180), key=away))
    for bone in poses:
        if bone.name.split()[0] in ("fk", "target", "pole"):
            bone.custom_shape = shape


def _add_controls(
    bones: bpy.types.bpy_prop_collection, deforming: list[str], limbs: list[tuple[str, str, str]]
) -> None:
    """Add FK bones for all bones, and for limbs IK bones, targets and poles."""

    def copied(name: str, new: str, parent: str | None) -> bpy.types.EditBone:
        bone = bones.new(new)
        bone.head, bone.tail, bone.roll = bones[name].head, bones[name].tail, bones[name].roll
        bone.parent, bone.use_deform = bones[parent] if parent else None, False
        return bone

    for name in deforming:
        copied(name, "fk " + name, "fk " + bones[name].parent.name if bones[name].parent else None)
    for one, two, end in limbs:
        copied(one, "ik " + one, "fk " + bones[one].parent.name)
        copied(two, "ik " + two, "ik " + one)
        copied(end, "target " + end, None)
        pole = copied(two, "pole " + end, None)
        way = bones[two].head - (bones[one].head + bones[end].head) / 2
        pole.head = bones[two].head + way.normalized() * 0.4
        pole.tail = pole.head + way.normalized() * 0.1


if __name__ == "__main__":
    for chosen in sys.argv[2:]:
        globals()[chosen]()
        bpy.ops.wm.save_as_mainfile(filepath=str(Path(sys.argv[1], f"{chosen}.blend").resolve()))
    sys.stdout.flush()
    os._exit(0)  # Blender may hang as it ends
