# SPDX-License-Identifier: GPL-3.0-or-later
"""Make, remove, import and export contacts."""

import json
from pathlib import Path

import bpy
from bpy_extras.io_utils import ExportHelper, ImportHelper

from .contacts import clip_frame, entries_of, listed, put
from .job import FailedError, target_of
from .rig import skeleton

ENDING = ".contacts.json"
CHOSEN = {"REGISTER", "UNDO"}


class Told:
    """An operator that reports what is wrong in one line."""

    def do(self, context: bpy.types.Context) -> None:
        raise NotImplementedError

    def execute(self, context):
        try:
            self.do(context)
        except FailedError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class DISTRETARGET_OT_contact_make(Told, bpy.types.Operator):
    """Bring the two selected bones together, or hold the one where it is: in the preview range, or in this frame"""

    bl_idname = "distretarget.contact_make"
    bl_label = "Make a contact"
    bl_options = CHOSEN

    parts: bpy.props.StringProperty(
        name="Parts", description='Two parts or joints, as in "left hand, hips", or one; else the selected bones'
    )

    def do(self, context):
        scene, settings = context.scene, context.scene.distretarget
        parts = [each.strip() for each in self.parts.split(",") if each.strip()] or _selected(context)
        if not settings.step:
            raise FailedError("retarget the clip once, so that its frames are known")
        if len({*parts}) not in (1, 2) or len({*parts}) < len(parts):
            raise FailedError("select two bones that are to touch, or one that is to stay where it is")
        span = (scene.frame_current, scene.frame_current)
        if scene.use_preview_range:
            span = (scene.frame_preview_start, scene.frame_preview_end)
        what = {"between": parts, "gap": 0.0} if len(parts) > 1 else {"plant": parts[0], "on": "where it is"}
        new = what | {"frames": [clip_frame(settings, frame) for frame in span]}
        with listed(scene):
            put(scene, settings.clip_key, [new], entries_of(scene, settings.clip_key))
        rows = enumerate(settings.contacts)
        settings.contact = next(n for n, row in rows if row.clip == settings.clip_key and json.loads(row.entry) == new)


def _selected(context: bpy.types.Context) -> list[str]:
    """The joints of the selected bones; for a control, the joint that is nearest."""
    armature = target_of(context)
    bones, found = armature.data.bones, {}
    joints = [name for name in skeleton(armature) if name in bones]
    for bone in context.selected_pose_bones or []:
        if bone.id_data == armature:
            place = bone.bone.head_local
            own = [bone.name] if bone.name in joints else joints
            found[min(own, key=lambda name: (bones[name].head_local - place).length)] = None
    return [*found]


class DISTRETARGET_OT_contact_remove(Told, bpy.types.Operator):
    """Take the contact out of the list; what is found in the clip comes back when it is retargeted"""

    bl_idname = "distretarget.contact_remove"
    bl_label = "Remove the contact"
    bl_options = CHOSEN

    def do(self, context):
        with listed(context.scene) as settings:
            if not 0 <= settings.contact < len(settings.contacts):
                raise FailedError("choose a contact in the list")
            settings.contacts.remove(settings.contact)
            settings.contact = max(0, min(settings.contact, len(settings.contacts) - 1))


class DISTRETARGET_OT_contacts_import(Told, ImportHelper, bpy.types.Operator):
    """Add the contacts of a contact file, as the command line takes it"""

    bl_idname = "distretarget.contacts_import"
    bl_label = "Import contacts"
    bl_options = CHOSEN
    filename_ext = ".json"
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})

    def do(self, context):
        from distretarget.errors import DistretargetError
        from distretarget.io.contacts_file import entry_to_json, load_contacts

        scene = context.scene
        try:
            entries = [json.loads(entry_to_json(entry)) for entry in load_contacts(self.filepath)]
        except DistretargetError as error:
            raise FailedError(str(error)) from None
        with listed(scene) as settings:
            put(scene, settings.clip_key, entries, entries_of(scene, settings.clip_key))


class DISTRETARGET_OT_contacts_export(Told, ExportHelper, bpy.types.Operator):
    """Write the contacts to a contact file, which the command line takes"""

    bl_idname = "distretarget.contacts_export"
    bl_label = "Export contacts"
    filename_ext = ".json"
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})

    def invoke(self, context, _event):
        settings = context.scene.distretarget
        clip = f"//{settings.clip_key}" if settings.performer else settings.clip
        self.filepath = str(Path(bpy.path.abspath(clip)).with_suffix(ENDING))
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def do(self, context):
        from distretarget.io.contacts_file import HEADER, contacts_to_json, parse_contacts

        with listed(context.scene) as settings:
            entries = entries_of(context.scene, settings.clip_key)
        text = contacts_to_json(parse_contacts(json.dumps(HEADER | {"contacts": entries}), "Contacts"))
        try:
            Path(self.filepath).write_text(text, "utf-8")
        except OSError as error:
            raise FailedError(f"{self.filepath}: {error.strerror}") from None


CLASSES = (
    DISTRETARGET_OT_contact_make,
    DISTRETARGET_OT_contact_remove,
    DISTRETARGET_OT_contacts_import,
    DISTRETARGET_OT_contacts_export,
)
