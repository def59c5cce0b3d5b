# SPDX-License-Identifier: GPL-3.0-or-later
"""Retarget a clip, or a folder of them, onto the active armature, while Blender goes on."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np

from .character import arrays_of
from .controls import keyed_controls
from .keys import Result, keyed_joints
from .rig import constraints_on, drivers_on, moved_bones

ENDINGS = (".bvh", ".fbx", ".glb", ".gltf", ".vrm", ".vrma", ".npz")
WORKER = Path(__file__).with_name("worker.py")
LOOKS = 0.1  # the process is looked at so often [s]


class FailedError(Exception):
    """What a user is told in a line."""


def target_of(context: bpy.types.Context) -> bpy.types.Object:
    """The active armature, or that of the active mesh."""
    chosen = context.active_object
    if chosen is not None and chosen.type == "MESH":
        chosen = chosen.find_armature()
    if chosen is None or chosen.type != "ARMATURE":
        raise FailedError("select the armature of a character, or its mesh")
    if chosen.library is not None or chosen.data.library is not None:
        raise FailedError(f"{chosen.name!r} is linked from another file; make it local or an override first")
    if not chosen.data.bones:
        raise FailedError(f"{chosen.name!r} has no bones")
    if min(chosen.matrix_world.to_scale()) <= 0.0 or np.ptp(chosen.matrix_world.to_scale()) > 1e-4:
        raise FailedError(f"{chosen.name!r} has an uneven scale; apply it with Ctrl+A")
    return chosen


class Job:
    """A clip that is retargeted by a process of its own."""

    def __init__(self, armature: bpy.types.Object, clip: Path, settings: bpy.types.PropertyGroup) -> None:
        if clip.suffix.lower() not in ENDINGS:
            raise FailedError(f"{clip.name or 'no file'}: expected a clip, {', '.join(ENDINGS)}")
        if not clip.is_file():
            raise FailedError(f"{clip}: there is no such file")
        self.armature, self.clip = armature, clip
        self.folder = tempfile.TemporaryDirectory(prefix="distretarget_")
        arrays = arrays_of(armature)
        self.names = arrays["names"].tolist()
        np.savez(Path(self.folder.name, "character.npz"), **arrays)
        job = {
            "clip": str(clip.resolve()),
            "animation": settings.animation,
            "edits": {"mirror": settings.mirror, "loop": settings.loop},
            "options": {"supports": settings.supports, "skin": settings.skin},
        }
        Path(self.folder.name, "job.json").write_text(json.dumps(job), "utf-8")
        paths = os.pathsep.join(filter(None, [*sys.path]))
        self.process = subprocess.Popen(
            [sys.executable, str(WORKER), self.folder.name],
            env=os.environ | {"PYTHONPATH": paths},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )

    @property
    def is_over(self) -> bool:
        return self.process.poll() is not None

    def stop(self) -> None:
        """End the process, and leave nothing."""
        if not self.is_over:
            self.process.kill()
        self.process.wait()
        self.folder.cleanup()

    def apply(self, scene: bpy.types.Scene, start: int) -> tuple[bpy.types.Action, dict]:
        """Wait for the process, and make an action of its result; return it and what there is to say."""
        said = self.process.communicate()[1].strip()
        told_in = Path(self.folder.name, "result.json")
        if self.process.returncode or not told_in.is_file():
            raise FailedError(f"the retargeting stopped: {said.splitlines()[-1] if said else self.process.returncode}")
        told = json.loads(told_in.read_text("utf-8"))
        if "error" in told:
            raise FailedError(told["error"])
        arrays = np.load(Path(self.folder.name, "result.npz"))
        result = Result(self.names, arrays["places"], arrays["turns"], float(arrays["frame_time"]))
        rate = scene.render.fps / scene.render.fps_base
        where = (self.armature, result, self.clip.stem, start, rate)
        if scene.distretarget.keys == "JOINTS":
            told["warnings"] += _muted(self.armature, self.names)
            action = keyed_joints(*where)
        else:
            action, lines = keyed_controls(*where, scene.distretarget.keys)
            told["warnings"] += lines
        return action, told | {"frames": len(result.places), "step": result.frame_time * rate, "start": start}


def _muted(armature: bpy.types.Object, joints: list[str]) -> list[str]:
    """A line on what is muted, since it would move the bones of joints."""
    moved = moved_bones(armature, joints)
    held = dict.fromkeys(bone.name for bone, _ in [*constraints_on(armature, moved), *drivers_on(armature, moved)])
    if not held:
        return []
    more = f" and {len(held) - 1} more bones" if len(held) > 1 else ""
    return [f"constraints and drivers of {next(iter(held))!r}{more} are muted; undo brings them back"]


class DISTRETARGET_OT_retarget(bpy.types.Operator):
    """Retarget the clip onto the active armature, as a new action"""

    bl_idname = "distretarget.retarget"
    bl_label = "Retarget"
    bl_options = {"REGISTER", "UNDO"}

    def invoke(self, context, _event):
        self.job, self.timer = None, None
        try:
            self.job = _job(context)
        except FailedError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.timer = context.window_manager.event_timer_add(LOOKS, window=context.window)
        context.window_manager.modal_handler_add(self)
        context.workspace.status_text_set("Retargeting ... Esc cancels")
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self._end(context)
            self.report({"INFO"}, "cancelled")
            return {"CANCELLED"}
        if event.type != "TIMER" or not self.job.is_over:
            return {"PASS_THROUGH"}
        status = _finish(self, context, self.job)
        self._end(context)
        return status

    def execute(self, context):
        """Without a window: at once."""
        try:
            job = _job(context)
        except FailedError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        status = _finish(self, context, job)
        job.stop()
        return status

    def _end(self, context):
        context.window_manager.event_timer_remove(self.timer)
        context.workspace.status_text_set(None)
        self.job.stop()


class DISTRETARGET_OT_retarget_folder(bpy.types.Operator):
    """Retarget all clips of the folder onto the active armature, an action each"""

    bl_idname = "distretarget.retarget_folder"
    bl_label = "Retarget a folder"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        settings, made, faults = context.scene.distretarget, 0, []
        folder = Path(bpy.path.abspath(settings.folder)) if settings.folder else None
        if folder is None or not folder.is_dir():
            self.report({"ERROR"}, "choose a folder of clips")
            return {"CANCELLED"}
        clips = sorted(path for path in folder.iterdir() if path.suffix.lower() in ENDINGS)
        manager = context.window_manager
        manager.progress_begin(0, max(len(clips), 1))
        for number, action in enumerate(_actions(context, clips, faults)):
            manager.progress_update(number)
            made += 1
            action.use_fake_user = True
            if settings.as_assets:
                action.asset_mark()
        manager.progress_end()
        settings.verdict = f"{made} of {len(clips)} clips retargeted" + "".join(f"; {fault}" for fault in faults)
        self.report({"WARNING" if faults else "INFO"}, settings.verdict)
        return {"FINISHED"} if made else {"CANCELLED"}


def _actions(context: bpy.types.Context, clips: list[Path], faults: list[str]) -> Iterator[bpy.types.Action]:
    """Yield the action of each clip; what is wrong with others is added to the faults."""
    for clip in clips:
        try:
            job = Job(target_of(context), clip, context.scene.distretarget)
            try:
                yield job.apply(context.scene, context.scene.distretarget.start)[0]
            finally:
                job.stop()
        except FailedError as error:
            faults.append(str(error))


class DISTRETARGET_OT_go_to(bpy.types.Operator):
    """Go to the frame of a warning"""

    bl_idname = "distretarget.go_to"
    bl_label = "Go to the frame"
    frame: bpy.props.IntProperty()

    def execute(self, context):
        context.scene.frame_set(self.frame)
        return {"FINISHED"}


def _job(context: bpy.types.Context) -> Job:
    settings = context.scene.distretarget
    if not settings.clip:
        raise FailedError("choose a clip")
    return Job(target_of(context), Path(bpy.path.abspath(settings.clip)), settings)


def _finish(operator: bpy.types.Operator, context: bpy.types.Context, job: Job) -> set[str]:
    """Make the action of a job, and say how it went."""
    settings = context.scene.distretarget
    try:
        _, told = job.apply(context.scene, settings.start)
    except FailedError as error:
        operator.report({"ERROR"}, str(error))
        return {"CANCELLED"}
    settings.verdict = told["verdict"]
    settings.warnings.clear()
    frames = {text: frame for frame, text in told["flags"]}
    for text in told["warnings"]:
        line = settings.warnings.add()
        line.text = text
        line.frame = round(told["start"] + frames[text] * told["step"]) if text in frames else -1
    last = told["start"] + (told["frames"] - 1) * told["step"]
    context.scene.frame_end = max(context.scene.frame_end, int(np.ceil(last)))
    operator.report({"INFO"}, told["verdict"])
    return {"FINISHED"}


CLASSES = (DISTRETARGET_OT_retarget, DISTRETARGET_OT_retarget_folder, DISTRETARGET_OT_go_to)
