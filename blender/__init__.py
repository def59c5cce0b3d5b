# SPDX-License-Identifier: GPL-3.0-or-later
"""Retarget motion to the character in the scene: a panel in the sidebar of the 3D view."""

import bpy

from . import operators


class DISTRETARGET_PG_warning(bpy.types.PropertyGroup):
    text: bpy.props.StringProperty()
    frame: bpy.props.IntProperty(default=-1)


class DISTRETARGET_PG_settings(bpy.types.PropertyGroup):
    clip: bpy.props.StringProperty(name="Clip", subtype="FILE_PATH", description="BVH, FBX, GLB, VRMA or npz")
    animation: bpy.props.StringProperty(name="Animation", description="Which of several animations of the file")
    folder: bpy.props.StringProperty(name="Folder", subtype="DIR_PATH", description="A folder of clips")
    start: bpy.props.IntProperty(name="Start", default=1, description="The frame at which the action begins")
    mirror: bpy.props.BoolProperty(name="Mirror", description="Exchange left and right")
    loop: bpy.props.BoolProperty(name="Loop", description="The end leads to the start")
    as_assets: bpy.props.BoolProperty(name="Mark as assets", description="Show the actions in the asset browser")
    supports: bpy.props.EnumProperty(
        name="Supports",
        description="What stays in place while it rests",
        items=[("hold", "Feet and all that rests", ""), ("feet", "Feet", ""), ("free", "Nothing", "")],
    )
    skin: bpy.props.EnumProperty(
        name="Skin",
        description="How thick the character is",
        items=[("auto", "Its meshes", ""), ("average", "Average", ""), ("none", "None", "")],
    )
    keys: bpy.props.EnumProperty(
        name="Keys",
        description="Which bones get the keys",
        items=[
            ("JOINTS", "Bones of the meshes", "Whatever else moves them is muted"),
            ("FK", "Controls, FK", "FK and IK controls, with switches at FK"),
            ("IK", "Controls, IK", "FK and IK controls, with switches at IK"),
        ],
    )
    verdict: bpy.props.StringProperty()
    warnings: bpy.props.CollectionProperty(type=DISTRETARGET_PG_warning)


class DISTRETARGET_PT_panel(bpy.types.Panel):
    bl_label = "Retarget"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Retarget"

    def draw(self, context):
        settings, layout = context.scene.distretarget, self.layout
        layout.use_property_split = True
        for name in ("clip", "animation", "start", "mirror", "loop", "supports", "skin", "keys"):
            layout.prop(settings, name)
        layout.operator("distretarget.retarget", icon="ARMATURE_DATA")
        if settings.verdict:
            layout.label(text=settings.verdict)
        for line in settings.warnings:
            row = layout.row()
            row.label(text=line.text, icon="ERROR")
            if line.frame >= 0:
                row.operator("distretarget.go_to", text=f"{line.frame}").frame = line.frame
        layout.separator()
        layout.prop(settings, "folder")
        layout.prop(settings, "as_assets")
        layout.operator("distretarget.retarget_folder")


CLASSES = (DISTRETARGET_PG_warning, DISTRETARGET_PG_settings, *operators.CLASSES, DISTRETARGET_PT_panel)


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.distretarget = bpy.props.PointerProperty(type=DISTRETARGET_PG_settings)


def unregister():
    del bpy.types.Scene.distretarget
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
