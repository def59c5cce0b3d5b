# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel *Retarget* in the sidebar of the 3D view: it draws settings and lists, and its buttons call operators."""

import json
import textwrap

import bpy

from .contacts import state_of, title_of
from .job import chosen_armature

LETTER = 7.5  # mean width of a letter [px]


class InSidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Retarget"


class DISTRETARGET_PT_panel(InSidebar, bpy.types.Panel):
    bl_label = "Retarget"

    def draw(self, context):
        settings, layout = context.scene.distretarget, self.layout
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.prop(settings, "clip")
        for name in ("performer", "animation", "start", "whole_frames", "mirror", "loop", "in_place", "keys"):
            layout.prop(settings, name)
        layout.operator("distretarget.retarget", icon="ARMATURE_DATA")
        letters = max(20, int(context.region.width / context.preferences.system.ui_scale / LETTER))
        column = layout.column(align=True)
        for text in textwrap.wrap(settings.verdict, letters):
            column.label(text=text)
        for line in settings.warnings:
            row = layout.row()
            column = row.column(align=True)
            for number, text in enumerate(textwrap.wrap(line.text, letters - 12)):
                column.label(text=text, icon="BLANK1" if number else "ERROR")
            if line.frame >= 0:
                row.operator("distretarget.go_to", text=f"{line.frame}").frame = line.frame


class DISTRETARGET_UL_contacts(bpy.types.UIList):
    def draw_item(self, _context, layout, data, item, _icon, _active, _property, index):
        entry = json.loads(item.entry)
        icon = {"FOUND": "LINKED", "DROP": "X"}.get(state_of(entry), "PINNED")
        layout.label(text=f"{index + 1}. {title_of(entry)}", icon=icon)
        if data.step:
            layout.operator("distretarget.go_to", text="", icon="TIME").frame = item.first

    def filter_items(self, _context, data, name):
        shown = [self.bitflag_filter_item if row.clip == data.clip_key else 0 for row in getattr(data, name)]
        return shown, []


class DISTRETARGET_PT_contacts(InSidebar, bpy.types.Panel):
    bl_label = "Contacts"
    bl_parent_id = "DISTRETARGET_PT_panel"

    def draw(self, context):
        settings, layout = context.scene.distretarget, self.layout
        layout.template_list("DISTRETARGET_UL_contacts", "", settings, "contacts", settings, "contact")
        row = layout.row(align=True)
        row.operator("distretarget.contact_make", text="Make", icon="ADD")
        row.operator("distretarget.contact_remove", text="Remove", icon="REMOVE")
        row = layout.row(align=True)
        row.operator("distretarget.contacts_import", text="Import")
        row.operator("distretarget.contacts_export", text="Export")
        layout.prop(settings, "markers")
        if 0 <= settings.contact < len(settings.contacts):
            item = settings.contacts[settings.contact]
            state = state_of(json.loads(item.entry))
            shown = ("state", "first", "last") if settings.step else ("state",)
            shown += {"GAP": ("gap", "firmness"), "SOURCE": ("firmness",)}.get(state, ())
            for name in shown if item.clip == settings.clip_key else ():
                layout.prop(item, name)


class DISTRETARGET_UL_pairs(bpy.types.UIList):
    def draw_item(self, context, layout, _data, item, _icon, _active, _property):
        layout.label(text=item.name, icon="PINNED" if item.is_chosen else "BONE_DATA")
        layout.prop_search(item, "source", context.scene.distretarget, "joints", text="")


class DISTRETARGET_PT_pairs(InSidebar, bpy.types.Panel):
    bl_label = "Bones and joints of the clip"
    bl_parent_id = "DISTRETARGET_PT_panel"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        armature = chosen_armature(context)
        if armature is None or not armature.distretarget_pairs:
            self.layout.label(text="Retarget once to see the pairs")
            return
        self.layout.template_list(
            "DISTRETARGET_UL_pairs", "", armature, "distretarget_pairs", armature, "distretarget_pair"
        )
        self.layout.operator("distretarget.forget_pairs")


class DISTRETARGET_PT_folder(InSidebar, bpy.types.Panel):
    bl_label = "A folder of clips"
    bl_parent_id = "DISTRETARGET_PT_panel"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        for name in ("folder", "as_assets", "push_down"):
            self.layout.prop(context.scene.distretarget, name)
        self.layout.operator("distretarget.retarget_folder")


CLASSES = (
    DISTRETARGET_PT_panel,
    DISTRETARGET_UL_contacts,
    DISTRETARGET_PT_contacts,
    DISTRETARGET_UL_pairs,
    DISTRETARGET_PT_pairs,
    DISTRETARGET_PT_folder,
)
