# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel *Retarget* in the sidebar of the 3D view: it draws settings and lists, and its buttons call operators."""

import json
import textwrap
from pathlib import Path

import bpy

from .contacts import state_of, title_of
from .job import chosen_armature

LETTER = 7.5  # mean width of a letter [px]


class InSidebar:
    bl_category = "Retarget"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"


class DISTRETARGET_PT_panel(InSidebar, bpy.types.Panel):
    bl_label = "Retarget"

    def draw(self, context):
        settings, layout = context.scene.distretarget, self.layout
        layout.use_property_split, layout.use_property_decorate = True, False
        for name in ("clip", "performer", "animation", "start", "whole_frames", "mirror", "loop", "in_place", "keys"):
            layout.prop(settings, name)
        layout.operator("distretarget.retarget", icon="ARMATURE_DATA")
        letters = max(20, int(context.region.width / context.preferences.system.ui_scale / LETTER))
        _wrap(layout, settings.verdict, letters, "NONE", "NONE")
        for line in settings.warnings:
            row = layout.row()
            _wrap(row, line.name, letters - 12, "ERROR", "BLANK1")
            if line.frame >= 0:
                _go_to(row, line.frame, text=f"{line.frame}")


def _section(name, label, draw, **members):
    """A subpanel of the extension's panel, which `draw` draws."""
    members |= {"bl_label": label, "bl_parent_id": "DISTRETARGET_PT_panel"}
    members["draw"] = lambda self, context: draw(self.layout, context.scene.distretarget, chosen_armature(context))
    return type(f"DISTRETARGET_PT_{name}", (InSidebar, bpy.types.Panel), members)


def _wrap(layout, text, letters, first, rest):
    """Draw text in lines, with one icon on the first line and another on the rest."""
    column = layout.column(align=True)
    for number, line in enumerate(textwrap.wrap(text, letters)):
        column.label(text=line, icon=rest if number else first)


def _go_to(layout, frame, **looks):
    """Draw a button that goes to a frame of the scene."""
    button = layout.operator("wm.context_set_int", **looks)
    button.data_path, button.value = "scene.frame_current", frame


def _contacts(layout, settings, _armature):
    layout.template_list("DISTRETARGET_UL_contacts", "", settings, "contacts", settings, "contact")
    row = layout.row(align=True)
    row.operator("distretarget.contact_make", text="Make", icon="ADD")
    row.operator("distretarget.contact_remove", text="Remove", icon="REMOVE")
    row = layout.row(align=True)
    row.operator("distretarget.contacts_import", text="Import")
    beside = f"//{settings.clip_key}" if settings.performer else settings.clip
    file = Path(bpy.path.abspath(beside) or "clip").with_suffix(".contacts.json")
    row.operator("distretarget.contacts_export", text="Export").filepath = str(file)
    layout.prop(settings, "markers")
    if 0 <= settings.contact < len(settings.contacts):
        item = settings.contacts[settings.contact]
        shown = ("state", "first", "last") if settings.step else ("state",)
        shown += {"GAP": ("gap", "firmness"), "SOURCE": ("firmness",)}.get(state_of(json.loads(item.entry)), ())
        for name in shown if item.clip == settings.clip_key else ():
            layout.prop(item, name)


def _pairs(layout, _settings, armature):
    if armature is None or not armature.distretarget_pairs:
        layout.label(text="Retarget once to see the pairs")
        return
    layout.template_list("DISTRETARGET_UL_pairs", "", armature, "distretarget_pairs", armature, "distretarget_pair")


def _folder(layout, settings, _armature):
    for name in ("folder", "as_assets", "push_down"):
        layout.prop(settings, name)
    layout.operator("distretarget.retarget_folder")


class DISTRETARGET_UL_contacts(bpy.types.UIList):
    def draw_item(self, _context, layout, data, item, _icon, _active, _property, index):
        entry = json.loads(item.entry)
        icon = {"FOUND": "LINKED", "DROP": "X"}.get(state_of(entry), "PINNED")
        layout.label(text=f"{index + 1}. {title_of(entry)}", icon=icon)
        if data.step:
            _go_to(layout, item.first, text="", icon="TIME")

    def filter_items(self, _context, data, name):
        shown = [self.bitflag_filter_item if row.clip == data.clip_key else 0 for row in getattr(data, name)]
        return shown, []


class DISTRETARGET_UL_pairs(bpy.types.UIList):
    def draw_item(self, context, layout, _data, item, _icon, _active, _property):
        layout.prop(item, "is_chosen", text=item.name, icon="PINNED" if item.is_chosen else "UNPINNED", emboss=False)
        layout.prop_search(item, "source", context.scene.distretarget, "joints", text="")


CLASSES = (
    DISTRETARGET_PT_panel,
    DISTRETARGET_UL_contacts,
    DISTRETARGET_UL_pairs,
    _section("contacts", "Contacts", _contacts),
    _section("pairs", "Bones and joints of the clip", _pairs, bl_options={"DEFAULT_CLOSED"}),
    _section("folder", "A folder of clips", _folder, bl_options={"DEFAULT_CLOSED"}),
)
