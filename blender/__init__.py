# SPDX-License-Identifier: GPL-3.0-or-later
"""Retarget motion to the character in the scene: a panel in the sidebar of the 3D view."""

import bpy

from . import operators, panel, settings

_register, _unregister = bpy.utils.register_classes_factory((*settings.GROUPS, *operators.CLASSES, *panel.CLASSES))


def register():
    _register()
    bpy.types.Scene.distretarget = bpy.props.PointerProperty(type=settings.DISTRETARGET_PG_settings)
    bpy.types.Object.distretarget_pairs = bpy.props.CollectionProperty(
        type=settings.DISTRETARGET_PG_pair, override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"}
    )
    bpy.types.Object.distretarget_muted = bpy.props.StringProperty(
        default="[]", description="What the last retargeting muted", override={"LIBRARY_OVERRIDABLE"}
    )
    bpy.types.Object.distretarget_pair = bpy.props.IntProperty(description="The pair that is chosen in the list")


def unregister():
    for name in ("pairs", "muted", "pair"):
        delattr(bpy.types.Object, f"distretarget_{name}")
    del bpy.types.Scene.distretarget
    _unregister()
