# SPDX-License-Identifier: GPL-3.0-or-later
"""Retarget a clip, or a folder of them, onto the active armature, while Blender goes on; and change contacts."""

import json
import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
from bpy_extras.io_utils import ExportHelper, ImportHelper

from .contacts import acts, clip_frame, entries_of, listed, put, take_markers
from .job import ENDINGS, LOOKS, FailedError, Job, names_of, target_of, there
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


class Running(Told):
    """An operator whose work goes on while Blender is used; Esc cancels it."""

    def work(self, context: bpy.types.Context) -> Iterator[str]:
        """Yield how far it is, in words; a FailedError says in a line what is wrong."""
        raise NotImplementedError

    def invoke(self, context, _event):
        self.steps, manager = self.work(context), context.window_manager
        self.timer = manager.event_timer_add(LOOKS, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self.cancel(context)
            self.report({"INFO"}, "cancelled")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            context.workspace.status_text_set(f"{next(self.steps)}; Esc cancels")
        except StopIteration:
            self.cancel(context)
            return {"FINISHED"}
        except FailedError as error:
            self.cancel(context)
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"RUNNING_MODAL"}

    def cancel(self, context):
        self.steps.close()
        context.window_manager.event_timer_remove(self.timer)
        context.workspace.status_text_set(None)

    def do(self, context):
        """Without a window: all at once."""
        for _ in self.work(context):
            time.sleep(LOOKS)


class DISTRETARGET_OT_retarget(Running, bpy.types.Operator):
    """Retarget the clip onto the active armature, as a new action; where none is chosen, choose a file"""

    bl_idname = "distretarget.retarget"
    bl_label = "Retarget"
    bl_options = CHOSEN
    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"HIDDEN", "SKIP_SAVE"})
    filter_glob: bpy.props.StringProperty(default=";".join(f"*{each}" for each in ENDINGS), options={"HIDDEN"})

    def invoke(self, context, event):
        settings = context.scene.distretarget
        if settings.clip or settings.performer:
            return super().invoke(context, event)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        if not self.filepath:
            return super().execute(context)
        context.scene.distretarget.clip = self.filepath
        return super().execute(context) if bpy.app.background else super().invoke(context, None)

    def work(self, context):
        settings = context.scene.distretarget
        if not settings.clip and settings.performer is None:
            raise FailedError("choose a clip, or an armature of the scene that moves")
        take_markers(context.scene)
        clip = settings.performer or Path(bpy.path.abspath(settings.clip))
        job = Job(context.scene, target_of(context), clip)
        try:
            yield from job.done()
            scene, _, told = job.apply()
        finally:
            job.stop()
        show(scene, job, told)
        self.report({"INFO"}, told["verdict"])


def show(scene: bpy.types.Scene, job: Job, told: dict[str, Any]) -> None:
    """Let the panel show how it went: verdict, warnings, contacts and pairs."""
    settings = scene.distretarget
    settings.verdict, frames = told["verdict"], {text: frame for frame, text in told["flags"]}
    settings.frames, settings.frame_time, settings.step = told["frames"], told["frame_time"], told["step"]
    settings.warnings.clear()
    for text in told["warnings"]:
        line = settings.warnings.add()
        line.text = text
        line.frame = round(job.start + frames[text] * told["step"]) if text in frames else -1
    settings.joints.clear()
    for name in told["joints"]:
        settings.joints.add().name = name
    with listed(scene):
        put(scene, job.key, filter(acts, entries_of(scene, job.key)), told["contacts"])
    pairs = there(job.names)[1].distretarget_pairs
    chosen = {pair.name: pair.source for pair in pairs if pair.is_chosen}
    pairs.clear()
    for name, source in told["pairs"]:
        pair = pairs.add()
        pair.name, pair.source = name, chosen.get(name, source)
        pair.is_chosen = name in chosen
    last = job.start + (told["frames"] - 1) * told["step"]
    scene.frame_end = max(scene.frame_end, math.ceil(round(last, 1)))  # frame times are rounded in files


class DISTRETARGET_OT_retarget_folder(Running, bpy.types.Operator):
    """Retarget all clips of the folder onto the active armature, an action each"""

    bl_idname = "distretarget.retarget_folder"
    bl_label = "Retarget a folder"
    bl_options = CHOSEN

    def work(self, context):
        settings = context.scene.distretarget
        names = names_of(context.scene, target_of(context))
        folder = Path(bpy.path.abspath(settings.folder)) if settings.folder else None
        if folder is None or not folder.is_dir():
            raise FailedError("choose a folder of clips")
        clips = sorted(path for path in folder.iterdir() if path.suffix.lower() in ENDINGS)
        made, faults = 0, []
        for number, clip in enumerate(clips):
            try:
                job = Job(*there(names), clip)
                try:
                    yield from (f"{clip.name}, {number + 1} of {len(clips)}. {text}" for text in job.done())
                    keep(*job.apply()[:2], there(names)[1])
                    made += 1
                finally:
                    job.stop()
            except FailedError as error:
                faults.append(str(error))
        if not made:
            raise FailedError("; ".join(faults) or f"{folder} has no clips: {', '.join(ENDINGS)}")
        verdict = f"{made} of {len(clips)} clips retargeted" + "".join(f"; {fault}" for fault in faults)
        there(names)[0].distretarget.verdict = verdict
        self.report({"WARNING" if faults else "INFO"}, verdict)


def keep(scene: bpy.types.Scene, action: bpy.types.Action, armature: bpy.types.Object) -> None:
    """Keep an action of a folder as an asset, and as an NLA track, where that is asked for."""
    settings = scene.distretarget
    action.use_fake_user = True
    if settings.as_assets:
        action.asset_mark()
    if settings.push_down:
        armature.animation_data.action = None
        track = armature.animation_data.nla_tracks.new()
        track.name = action.name
        track.strips.new(action.name, int(action.frame_range[0]), action)


class DISTRETARGET_OT_go_to(bpy.types.Operator):
    """Go to the frame"""

    bl_idname = "distretarget.go_to"
    bl_label = "Go to the frame"
    frame: bpy.props.IntProperty()

    def execute(self, context):
        context.scene.frame_set(self.frame)
        return {"FINISHED"}


class DISTRETARGET_OT_forget_pairs(Told, bpy.types.Operator):
    """Find all pairs of joints anew when it is retargeted again"""

    bl_idname = "distretarget.forget_pairs"
    bl_label = "Find all anew"
    bl_options = CHOSEN

    def do(self, context):
        target_of(context).distretarget_pairs.clear()


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
    DISTRETARGET_OT_retarget,
    DISTRETARGET_OT_retarget_folder,
    DISTRETARGET_OT_go_to,
    DISTRETARGET_OT_forget_pairs,
    DISTRETARGET_OT_contact_make,
    DISTRETARGET_OT_contact_remove,
    DISTRETARGET_OT_contacts_import,
    DISTRETARGET_OT_contacts_export,
)
