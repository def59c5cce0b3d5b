# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators: retarget a clip or a folder to the active armature, while Blender stays usable, and change contacts."""

import inspect
import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper, ImportHelper

from distretarget.errors import DistretargetError, SettingsError

from .contacts import changing_contacts, clip_frame, entries_of, put, state_of, take_markers
from .job import ENDINGS, Job, objects_of, target_of
from .rig import frame_time_of, skeleton

INTERVAL = 0.05  # between two looks at the progress of a process [s]
HIDDEN = {"HIDDEN", "SKIP_SAVE"}
JSON = {"filter_glob": StringProperty(default="*.json", options=HIDDEN)}
CLASSES = []


class Reporting:
    """An operator that calls its `do`, and reports an error in one line."""

    def execute(self, context):
        try:
            for _ in self.do(context) or ():
                time.sleep(INTERVAL)
        except DistretargetError as error:
            return self.stopped("ERROR", str(error))
        return {"FINISHED"}

    def stopped(self, kind, line):
        self.report({kind}, line)
        return {"CANCELLED"}


class Running(Reporting):
    """A modal operator, during which Blender stays usable and Esc cancels; its `do` yields its progress as text."""

    def execute(self, context):
        if bpy.app.background:
            return super().execute(context)
        self.steps, manager = self.do(context), context.window_manager
        self.timer = manager.event_timer_add(INTERVAL, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        status = {"RUNNING_MODAL" if event.type == "TIMER" else "PASS_THROUGH"}
        try:
            if event.type == "TIMER":
                context.workspace.status_text_set(f"{next(self.steps)}; Esc cancels")
            elif event.type == "ESC":
                status = self.stopped("INFO", "cancelled")
        except StopIteration:
            status = {"FINISHED"}
        except DistretargetError as error:
            status = self.stopped("ERROR", str(error))
        if status & {"FINISHED", "CANCELLED"}:
            self.cancel(context)
        return status

    def cancel(self, context):
        self.steps.close()
        context.window_manager.event_timer_remove(self.timer)
        context.workspace.status_text_set(None)


def operator(label: str, *bases: type, **properties: Any) -> Callable:
    """A decorator that makes an operator, `distretarget.NAME`, of a function, whose docstring becomes the tooltip."""

    def made(do: Callable) -> type:
        kind = Running if inspect.isgeneratorfunction(do) else Reporting
        members = {"bl_idname": f"distretarget.{do.__name__}", "bl_label": label, "bl_options": {"REGISTER", "UNDO"}}
        members |= {"do": do, "__doc__": do.__doc__, "__annotations__": properties, "filename_ext": ".json"}
        CLASSES.append(type(f"DISTRETARGET_OT_{do.__name__}", (*bases, kind, bpy.types.Operator), members))
        return CLASSES[-1]

    return made


class AsksForClip:
    """Opens a file dialog if no clip is chosen."""

    def invoke(self, context, _event):
        settings = context.scene.distretarget
        if settings.clip or settings.performer:
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


@operator(
    "Retarget",
    AsksForClip,
    filepath=StringProperty(subtype="FILE_PATH", options=HIDDEN),
    filter_glob=StringProperty(default=";".join(f"*{each}" for each in ENDINGS), options=HIDDEN),
)
def retarget(self, context):
    """Retarget the clip to the active armature, as a new action; asks for a file if none is chosen"""
    settings = context.scene.distretarget
    if self.filepath:
        settings.clip = self.filepath
    if not settings.clip and settings.performer is None:
        raise SettingsError("choose a clip, or an armature of the scene that moves")
    take_markers(context.scene)
    clip = settings.performer or Path(bpy.path.abspath(settings.clip))
    job = Job((context.scene.name, target_of(context).name), clip)
    yield from job.done()
    job.apply()
    _show(job)
    self.report({"INFO"}, job.answer["verdict"])


def _show(job: Job) -> None:
    """Show verdict, warnings, contacts and pairs in the panel."""
    (scene, armature), answer = objects_of(job.names), job.answer
    settings, pairs = scene.distretarget, armature.distretarget_pairs
    settings.verdict, (settings.frames, settings.frame_time) = answer["verdict"], answer["clip"]
    settings.step = answer["clip"][1] / frame_time_of(scene)
    settings.warnings.clear()
    for text, frame in answer["warnings"]:
        line = settings.warnings.add()
        line.name, line.frame = text, -1 if frame is None else round(job.start + frame * settings.step)
    settings.joints.clear()
    for name in answer["joints"]:
        settings.joints.add().name = name
    with changing_contacts(scene):
        changed = [entry for entry in entries_of(scene, job.key) if state_of(entry) != "FOUND"]
        put(scene, job.key, changed, answer["contacts"])
    chosen = {pair.name: pair.source for pair in pairs if pair.is_chosen}
    pairs.clear()
    for name, source in answer["pairs"]:
        pair = pairs.add()
        pair.name, pair.source = name, chosen.get(name, source)
        pair.is_chosen = name in chosen
    last = job.start + (settings.frames - 1) * settings.step
    scene.frame_end = max(scene.frame_end, math.ceil(round(last, 1)))  # frame times are rounded in files


@operator("Retarget a folder")
def retarget_folder(self, context):
    """Retarget all clips of the folder to the active armature, as an action each"""
    settings, names, errors = context.scene.distretarget, (context.scene.name, target_of(context).name), []
    folder = Path(bpy.path.abspath(settings.folder)) if settings.folder else None
    if folder is None or not folder.is_dir():
        raise SettingsError("choose a folder of clips")
    clips = sorted(path for path in folder.iterdir() if path.suffix.lower() in ENDINGS)
    for number, clip in enumerate(clips):
        try:
            job = Job(names, clip)
            yield from (f"{clip.name}, {number + 1} of {len(clips)}. {text}" for text in job.done())
            _keep(job.apply(), *objects_of(names))
        except DistretargetError as error:
            errors.append(str(error))
    if len(errors) == len(clips):
        raise SettingsError("; ".join(errors) or f"{folder} has no clips: {', '.join(ENDINGS)}")
    verdict = "; ".join([f"{len(clips) - len(errors)} of {len(clips)} clips retargeted", *errors])
    objects_of(names)[0].distretarget.verdict = verdict
    self.report({"WARNING" if errors else "INFO"}, verdict)


def _keep(action: bpy.types.Action, scene: bpy.types.Scene, armature: bpy.types.Object) -> None:
    """Keep an action, and as the settings say mark it as an asset and make an NLA track of it."""
    action.use_fake_user = True
    if scene.distretarget.as_assets:
        action.asset_mark()
    if scene.distretarget.push_down:
        armature.animation_data.action = None
        track = armature.animation_data.nla_tracks.new()
        track.name = action.name
        track.strips.new(action.name, int(action.frame_range[0]), action)


@operator("Make a contact")
def contact_make(_self, context):
    """Bring two selected bones together, or hold a single one in place: in the preview range, or in this frame"""
    scene, settings, parts = context.scene, context.scene.distretarget, _selected(context)
    if not settings.step:
        raise SettingsError("retarget the clip once, so that its frames are known")
    if len(parts) not in (1, 2):
        raise SettingsError("select two bones that are to touch, or one that is to stay where it is")
    span = (scene.frame_current, scene.frame_current)
    if scene.use_preview_range:
        span = (scene.frame_preview_start, scene.frame_preview_end)
    entry = {"between": parts, "gap": 0.0} if len(parts) > 1 else {"plant": parts[0], "on": "where it is"}
    entry |= {"frames": [clip_frame(settings, frame) for frame in span]}
    with changing_contacts(scene):
        put(scene, settings.clip_key, [entry], entries_of(scene, settings.clip_key))
    rows = [(row.clip, json.loads(row.entry)) for row in settings.contacts]
    settings.contact = rows.index((settings.clip_key, entry))


def _selected(context: bpy.types.Context) -> list[str]:
    """The joints of the selected bones; for a control, the nearest joint."""
    armature = target_of(context)
    bones, found = armature.data.bones, {}
    joints = [name for name in skeleton(armature) if name in bones]
    for bone in context.selected_pose_bones or []:
        if bone.id_data == armature:
            head = bone.bone.head_local
            choice = [bone.name] if bone.name in joints else joints
            found[min(choice, key=lambda name: (bones[name].head_local - head).length)] = None
    return [*found]


@operator("Remove the contact")
def contact_remove(_self, context):
    """Remove the contact from the list; one that is found in the clip comes back when it is retargeted"""
    with changing_contacts(context.scene) as settings:
        if not 0 <= settings.contact < len(settings.contacts):
            raise SettingsError("choose a contact in the list")
        settings.contacts.remove(settings.contact)
        settings.contact = max(0, min(settings.contact, len(settings.contacts) - 1))


@operator("Import contacts", ImportHelper, **JSON)
def contacts_import(self, context):
    """Add the contacts of a contact file, such as the command line writes"""
    from distretarget import contacts_to_json, load_contacts

    entries = json.loads(contacts_to_json(load_contacts(self.filepath)))["contacts"]
    with changing_contacts(context.scene) as settings:
        put(context.scene, settings.clip_key, entries, entries_of(context.scene, settings.clip_key))


@operator("Export contacts", ExportHelper, **JSON)
def contacts_export(self, context):
    """Write the contacts to a contact file, for use with the command line"""
    from distretarget.io.contacts_file import HEADER, contacts_to_json, parse_contacts
    from distretarget.io.files import write_whole

    with changing_contacts(context.scene) as settings:
        entries = entries_of(context.scene, settings.clip_key)
    contacts = parse_contacts(json.dumps(HEADER | {"contacts": entries}), "Contacts")
    write_whole(self.filepath, contacts_to_json(contacts), overwrite=True)
