"""Characters that are hard to move, made in Blender of the basic human of the add-on Rigify, with a box for each bone.

Each function with a character's name changes that human, which has Rigify's names, and may bring its own meshes.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager

import bpy
from mathutils import Euler, Matrix, Vector

# Rigify's names without sides, and odd names for the same bones; {} is the side.
ODD = (
    "spine=Hips,spine.001=Spine,spine.002=Chest,spine.003=Brust/Oberkörper,spine.004=Neck,spine.005=Neck 2,"
    "spine.006=頭,shoulder={} Shoulder,upper_arm={} Upper Arm,forearm={} Lower Arm,hand={}:Hand.x,"
    "thigh={} Upper Leg,shin={} Lower Leg,foot={} Foot,toe={} Toes"
)
LIMBS = [
    (one + side, two + side, end + side)
    for side in (".L", ".R")
    for one, two, end in (("upper_arm", "forearm", "hand"), ("thigh", "shin", "foot"))
]
NO_BONES = ("breast", "pelvis", "heel")  # parts of Rigify's human that other characters lack

Armature = bpy.types.Object
Bones = bpy.types.bpy_prop_collection


def made(name: str) -> Armature:
    """Make a character in an empty scene, and return its armature, which is active."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="rigify")
    bpy.ops.object.armature_basic_human_metarig_add()
    armature = bpy.context.object
    if name == "rigify":
        bpy.ops.pose.rigify_generate()
        return bpy.context.object
    armature.name = armature.data.name = "Armature"
    with edit_bones(armature) as bones:
        for spare in [bone for bone in bones if bone.name.startswith(NO_BONES)]:
            bones.remove(spare)
    globals()[name](armature)
    if not bpy.data.meshes:
        add_boxes(armature)
    bpy.context.view_layer.objects.active = armature
    return armature


@contextmanager
def edit_bones(armature: Armature) -> Iterator[Bones]:
    """The bones of an armature in edit mode."""
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    yield armature.data.edit_bones
    bpy.ops.object.mode_set(mode="OBJECT")


def add_boxes(armature: Armature, skinned: bool = True) -> None:
    """Give each deforming bone a box: in one mesh that the armature deforms, or as meshes that hang on the bones."""
    bones = [bone for bone in armature.data.bones if bone.use_deform]
    boxes = [hung(armature, each.name, Vector((0.3, 0.88, 0.3)) * each.length, 0.46 * each.length) for each in bones]
    if skinned:
        for bone, box in zip(bones, boxes, strict=True):
            box.vertex_groups.new(name=bone.name).add(range(8), 1.0, "REPLACE")
            box.parent = None
            box.data.transform(bone.matrix_local)
        with bpy.context.temp_override(active_object=boxes[0], selected_editable_objects=boxes):
            bpy.ops.object.join()
        boxes[0].name, boxes[0].parent, boxes[0].matrix_parent_inverse = "Body", armature, Matrix()
        boxes[0].modifiers.new("Armature", "ARMATURE").object = armature


def new_object(name: str, data: bpy.types.ID | None) -> bpy.types.Object:
    """A new object in the scene."""
    new = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(new)
    return new


def hung(armature: Armature, bone: str, size: Vector, along: float = 0.0) -> bpy.types.Object:
    """A box whose parent is a bone, and whose centre is so far along it."""
    bpy.ops.mesh.primitive_cube_add(size=1)
    box = bpy.context.object
    box.data.transform(Matrix.LocRotScale((0, along, 0), None, size))
    box.parent, box.parent_type, box.parent_bone = armature, "BONE", bone
    box.matrix_parent_inverse = Matrix.Translation((0, -armature.data.bones[bone].length, 0))
    return box


def add_bone(armature: Armature, name: str, head: Vector, tail: Vector, parent: str | None = None) -> None:
    with edit_bones(armature) as bones:
        bone = bones.new(name)
        bone.head, bone.tail, bone.parent = head, tail, bones[parent] if parent else None


def names_with_spaces(armature: Armature) -> None:
    """Names as in Unity's humanoid, such as Left Upper Arm; also colons, slashes, dots and other alphabets."""
    by_part = dict(pair.split("=") for pair in ODD.split(","))
    for bone in armature.data.bones:
        part = bone.name.removesuffix(".L").removesuffix(".R")
        bone.name = by_part[part].format("Right" if bone.name.endswith(".R") else "Left")


def more_bones(armature: Armature) -> None:
    """A root bone, twist bones that have skin, a skirt of eight bones whose sway hangs from the hips, IK bones that
    have no skin, and a staff as a mesh on a hand.
    """
    add_bone(armature, "root", Vector(), Vector((0, 0.2, 0)))
    with edit_bones(armature) as bones:
        bones["spine"].parent = bones["root"]
    bones = armature.data.bones
    for name in ("upper_arm.L", "upper_arm.R", "forearm.L", "forearm.R", "shin.L", "shin.R"):
        bone = bones[name]
        middle = (bone.head_local + bone.tail_local) / 2
        add_bone(armature, f"{name[:-2]}_twist_01{name[-2:]}", middle, bone.tail_local, name)
    hips = bones["spine"].head_local.copy()
    for number in range(8):
        way = Matrix.Rotation(number * math.pi / 4, 3, "Z") @ Vector((0.2, 0, 0))
        top, end = hips + way, hips + 1.3 * way - Vector((0, 0, 0.2))
        add_bone(armature, f"skirt {number}", top, end, "spine")
        add_bone(armature, f"hem {number}", end, 2 * end - top, f"skirt {number}")
    add_boxes(armature)
    for end in ("foot.L", "foot.R", "hand.L", "hand.R"):
        add_bone(armature, f"ik_{end}", bones[end].head_local, bones[end].tail_local, "root")
    hung(armature, "hand.R", Vector((0.02, 0.02, 1)))


def blocks(armature: Armature) -> None:
    """A figure of blocks: arms and legs are one bone each, without ends."""
    tops = {"upper_arm.L": "hand.L", "upper_arm.R": "hand.R", "thigh.L": "foot.L", "thigh.R": "foot.R", "spine.006": ""}
    with edit_bones(armature) as bones:
        for name, end in tops.items():
            bones[name].use_connect, bones[name].parent = False, bones["spine"]
            bones[name].tail = bones[end].head if end else bones[name].tail
        for spare in [bone for bone in bones if bone.name not in {"spine", *tops}]:
            bones.remove(spare)
    for name, own in zip(tops, ("LeftArm", "RightArm", "LeftLeg", "RightLeg", "Head"), strict=True):
        armature.data.bones[name].name = own


def scale_001(armature: Armature) -> None:
    """An armature in centimetres with Y up, below an object with scale 0.01, turned by 90 degrees. Upper arms and head
    keep their direction when the trunk turns; hands do not inherit scale.
    """
    turn = Matrix.Rotation(math.radians(90), 4, "X") @ Matrix.Scale(0.01, 4)
    armature.data.transform(turn.inverted())
    armature.matrix_world = turn
    for name in ("upper_arm.L", "upper_arm.R", "spine.006"):
        armature.data.bones[name].use_inherit_rotation = False
    for name in ("hand.L", "hand.R"):
        armature.data.bones[name].inherit_scale = "NONE"


def ik(armature: Armature) -> None:
    """IK of arms and legs, with targets that count as deforming but move no mesh, as Blender makes bones. The mesh has
    a shape key and modifiers; and there is a crane for the camera, an armature that moves no mesh.
    """
    add_boxes(armature)
    body = bpy.data.objects["Body"]
    body.shape_key_add(name="Basis")
    body.shape_key_add(name="Smile").value = 0.5
    body.modifiers.new("Smooth", "SUBSURF").levels = 1
    body.modifiers.new("Mirror", "MIRROR")
    add_bone(new_object("Crane", bpy.data.armatures.new("Crane")), "arm", Vector(), Vector((0, 0, 3)))
    for _, bone, end in LIMBS:
        target, rest = f"{end[:-2]}_ik{end[-2:]}", armature.data.bones[end]
        add_bone(armature, target, rest.head_local, rest.tail_local)
        constrain(armature, bone, "IK", target).chain_count = 2


def constrain(armature: Armature, bone: str, kind: str, target: str) -> bpy.types.Constraint:
    """A new constraint of a bone whose target is another."""
    constraint = armature.pose.bones[bone].constraints.new(kind)
    constraint.target, constraint.subtarget = armature, target
    return constraint


def constraints(armature: Armature) -> None:
    """A hand held to the head, a limited foot, IK from a toe up to the root; bones that are locked or scaled."""
    constrain(armature, "hand.L", "CHILD_OF", "spine.006")
    constrain(armature, "toe.L", "IK", "hand.R")
    limits = armature.pose.bones["foot.L"].constraints.new("LIMIT_ROTATION")
    limits.use_limit_x = limits.use_limit_y = limits.use_limit_z = True
    limits.owner_space = "LOCAL"
    for bone in armature.pose.bones:
        bone.lock_location = bone.lock_rotation = (True, True, True)
    armature.data.bones["forearm.L"].use_local_location = False
    armature.pose.bones["spine"].rotation_mode = "AXIS_ANGLE"
    armature.pose.bones["spine"].scale = (2, 2, 2)


def drivers(armature: Armature) -> None:
    """The left forearm bends with the right one, by a driver."""
    for bone in armature.pose.bones:
        bone.rotation_mode = "XYZ"
    driver = armature.pose.bones["forearm.L"].driver_add("rotation_euler", 0).driver
    variable = driver.variables.new()
    variable.type, variable.name = "TRANSFORMS", "angle"
    target = variable.targets[0]
    target.id, target.bone_target = armature, "forearm.R"
    target.transform_type, target.transform_space = "ROT_X", "LOCAL_SPACE"
    driver.expression = "angle + 0.3"


def two_characters(armature: Armature) -> None:
    """Two armatures with a skinned mesh each, so that somebody has to choose."""
    add_boxes(armature)
    body = bpy.data.objects["Body"]
    twin, skin = (new_object(f"{one.name} 2", one.data.copy()) for one in (armature, body))
    twin.location.x, skin.parent = 2, twin
    for group in body.vertex_groups:
        skin.vertex_groups.new(name=group.name)
    skin.modifiers.new("Armature", "ARMATURE").object = twin


def two_roots(armature: Armature) -> None:
    """The body, and a lantern beside it, without a common root; the armature is hidden in viewports."""
    add_bone(armature, "lantern", Vector((1, 0, 1)), Vector((1, 0, 1.3)))
    add_boxes(armature)
    armature.hide_viewport = True


def meshes_on_bones(armature: Armature) -> None:
    """A robot: every part is a mesh that hangs on a bone, and nothing is skinned."""
    add_boxes(armature, skinned=False)


def posed(armature: Armature) -> None:
    """A pose in the file that is not the bind pose."""
    for number, bone in enumerate(armature.pose.bones):
        bone.rotation_mode = "QUATERNION"
        bone.rotation_quaternion = Euler((0.3 * math.sin(number), 0.2 * math.cos(number), 0.1)).to_quaternion()


def copies(rig: Armature) -> None:
    """Deforming bones copy FK bones, or IK bones with poles by a property of the targets."""
    deforming, shape = rig.data.bones.keys(), bpy.data.objects.new("shape", None)
    with edit_bones(rig) as bones:
        _add_controls(bones, deforming)
    poses = rig.pose.bones
    for name in deforming:
        constrain(rig, name, "COPY_TRANSFORMS", "fk " + name)
    for one, two, end in LIMBS:
        poses["target " + end]["ik"] = 0.0
        for name, source in ((one, "ik " + one), (two, "ik " + two), (end, "target " + end)):
            driver = constrain(rig, name, "COPY_TRANSFORMS", source).driver_add("influence").driver
            target = driver.variables.new().targets[0]
            target.id, target.data_path, driver.type = rig, f'pose.bones["target {end}"]["ik"]', "AVERAGE"
        ik = constrain(rig, "ik " + two, "IK", "target " + end)
        ik.pole_target, ik.pole_subtarget, ik.chain_count = rig, "pole " + end, 2

        def away(degrees: int, ik: bpy.types.Constraint = ik, two: str = two) -> float:
            ik.pole_angle = math.radians(degrees)
            bpy.context.view_layer.update()
            return (poses["ik " + two].head - rig.data.bones[two].head_local).length

        ik.pole_angle = math.radians(min(range(-180, 180), key=away))
    for bone in poses:
        if bone.name.split()[0] in ("fk", "target", "pole"):
            bone.custom_shape = shape


def _add_controls(bones: Bones, deforming: list[str]) -> None:
    """Add FK bones for all bones, and for limbs IK bones, targets and poles."""

    def copied(name: str, new: str, parent: str | None) -> bpy.types.EditBone:
        bone = bones.new(new)
        bone.head, bone.tail, bone.roll = bones[name].head, bones[name].tail, bones[name].roll
        bone.parent, bone.use_deform = bones[parent] if parent else None, False
        return bone

    for name in deforming:
        copied(name, "fk " + name, "fk " + bones[name].parent.name if bones[name].parent else None)
    for one, two, end in LIMBS:
        copied(one, "ik " + one, "fk " + bones[one].parent.name)
        copied(two, "ik " + two, "ik " + one)
        copied(end, "target " + end, None)
        pole = copied(two, "pole " + end, None)
        way = (bones[two].head - (bones[one].head + bones[end].head) / 2).normalized()
        pole.head, pole.tail = bones[two].head + way * 0.4, bones[two].head + way * 0.5
