# SPDX-License-Identifier: GPL-3.0-or-later
"""Retarget a clip, or a folder of them, onto the active armature, while Blender goes on."""

import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

from .contact_operators import CHOSEN, Told
from .contacts import acts, entries_of, listed, put, take_markers
from .job import ENDINGS, LOOKS, FailedError, Job, names_of, target_of, there


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
    """Retarget the clip onto the active armature, as a new action"""

    bl_idname = "distretarget.retarget"
    bl_label = "Retarget"
    bl_options = CHOSEN

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
    scene.frame_end = max(scene.frame_end, math.ceil(last))


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
                    keep(*job.apply()[:2], there(names)[1], is_last=number == len(clips) - 1)
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


def keep(scene: bpy.types.Scene, action: bpy.types.Action, armature: bpy.types.Object, is_last: bool) -> None:
    """Keep an action of a folder as an asset, and as an NLA track, where that is asked for."""
    settings, start = scene.distretarget, int(action.frame_range[0])
    action.use_fake_user = True
    if settings.as_assets:
        action.asset_mark()
    if settings.push_down:
        data = armature.animation_data
        data.action = None
        track = data.nla_tracks.new()
        track.name, track.mute = action.name, not is_last
        track.strips.new(action.name, start, action)


class DISTRETARGET_OT_go_to(bpy.types.Operator):
    """Go to the frame"""

    bl_idname = "distretarget.go_to"
    bl_label = "Go to the frame"
    frame: bpy.props.IntProperty()

    def execute(self, context):
        context.scene.frame_set(self.frame)
        return {"FINISHED"}


class DISTRETARGET_OT_forget_pairs(bpy.types.Operator):
    """Find all pairs of joints anew when it is retargeted again"""

    bl_idname = "distretarget.forget_pairs"
    bl_label = "Find all anew"
    bl_options = CHOSEN

    def execute(self, context):
        try:
            target_of(context).distretarget_pairs.clear()
        except FailedError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


CLASSES = (
    DISTRETARGET_OT_retarget,
    DISTRETARGET_OT_retarget_folder,
    DISTRETARGET_OT_go_to,
    DISTRETARGET_OT_forget_pairs,
)
