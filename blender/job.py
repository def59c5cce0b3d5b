# SPDX-License-Identifier: GPL-3.0-or-later
"""A job: a clip that a separate process retargets to a character, so that Blender can be used meanwhile."""

import json
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np

from distretarget.errors import SettingsError

from .contacts import entries_of, state_of
from .keys import keyed, poses_of
from .rig import carriers, frame_time_of, mute_others, performance_of, shape_of, title_of
from .settings import clip_key

ENDINGS = (".bvh", ".fbx", ".glb", ".gltf", ".vrm", ".vrma", ".npz")
WORKER = Path(__file__).with_name("worker.py")


def chosen_armature(context: bpy.types.Context) -> bpy.types.Object | None:
    """The active armature, or that of the active mesh."""
    chosen = context.active_object
    if chosen is not None and chosen.type == "MESH":
        chosen = chosen.find_armature()
    return chosen if chosen is not None and chosen.type == "ARMATURE" else None


def target_of(context: bpy.types.Context) -> bpy.types.Object:
    """The chosen armature; a SettingsError if it cannot get a motion."""
    chosen = chosen_armature(context)
    if chosen is None:
        raise SettingsError("select the armature of a character, or its mesh")
    if chosen.library is not None:
        raise SettingsError(f"{chosen.name!r} is linked from another file; make it local or an override first")
    scale = chosen.matrix_world.to_scale()
    if min(scale) <= 0.0 or np.ptp(scale) > 1e-4 * max(scale):
        raise SettingsError(f"{chosen.name!r} has an uneven scale; apply it with Ctrl+A")
    return chosen


Names = tuple[str, str]  # of a scene and an armature; objects cannot be kept, since undo replaces them


def objects_of(names: Names) -> tuple[bpy.types.Scene, bpy.types.Object]:
    """The scene and the armature with these names; a SettingsError if they are gone."""
    scene, armature = bpy.data.scenes.get(names[0]), bpy.data.objects.get(names[1])
    if scene is None or armature is None or armature.type != "ARMATURE":
        raise SettingsError(f"{names[1]!r} or its scene is gone; the motion was dropped")
    return scene, armature


class Job:
    """A clip that is retargeted to an armature."""

    def __init__(self, names: Names, clip: Path | bpy.types.Object) -> None:
        """`names` are those of the scene and the armature; `clip` is a file, or an armature that moves."""
        (scene, armature), self.names = objects_of(names), names
        settings, is_file = scene.distretarget, isinstance(clip, Path)
        if clip == armature:
            raise SettingsError(f"{clip.name!r} is the character; choose another armature for the clip")
        self.title = clip.stem if is_file else title_of(clip)
        self.key = clip_key(clip, settings.animation) if is_file else self.title
        self.keys, self.start, self.bones = settings.keys, settings.start, armature.data.bones.keys()
        job = {
            "clip": clip.resolve() if is_file else None,
            "performer": None if is_file else performance_of(clip, scene),
            "character": shape_of(armature),
            "animation": settings.animation,
            "edits": {"mirror": settings.mirror, "loop": settings.loop},
            "in_place": settings.in_place,
            "frame_time": frame_time_of(scene) if settings.whole_frames else None,
            "contacts": [entry for entry in entries_of(scene, self.key) if state_of(entry) != "FOUND"],
            "map": {pair.name: pair.source or None for pair in armature.distretarget_pairs if pair.is_chosen},
            "armature": armature.name,
            "frame": scene.frame_current,
            "muted": json.loads(armature.distretarget_muted),
            "keys": self.keys,
        }
        self.temporary = tempfile.TemporaryDirectory(prefix="distretarget_")
        self.folder = Path(self.temporary.name)
        (self.folder / "job").write_bytes(pickle.dumps(sys.path) + pickle.dumps(job))
        if self.keys != "JOINTS":
            bpy.data.libraries.write(str(self.folder / "character.blend"), {armature}, path_remap="ABSOLUTE")

    def done(self) -> Iterator[str]:
        """Run the process; yield its progress as text until it has finished."""
        progress, log, answer = (self.folder / name for name in ("progress", "log", "answer"))
        progress.write_text("Retargeting", "utf-8")
        with log.open("wb") as output:
            self.process = subprocess.Popen([*self._command(), str(self.folder)], stdout=output, stderr=output)
        try:
            while self.process.poll() is None:
                yield progress.read_text("utf-8")
            if self.process.returncode or not answer.is_file():
                lines = [self.process.returncode, *log.read_text("utf-8", "replace").split("\n")]
                last = next(line for line in reversed(lines) if line and str(line).strip())
                raise SettingsError(f"retargeting stopped: {last}; nothing is changed")
            self.answer = pickle.loads(answer.read_bytes())
            if "error" in self.answer:
                raise SettingsError(self.answer["error"])
        finally:
            self.process.kill()
            self.process.wait()
            self.temporary.cleanup()

    def _command(self) -> list[str]:
        """The command that runs the worker in Python, or to set controls in another Blender, without user settings."""
        if self.keys == "JOINTS" or not bpy.app.binary_path:  # without a path, Blender is a module of Python
            return [sys.executable, str(WORKER)]
        scripts = "--disable-autoexec" if bpy.app.autoexec_fail else "--enable-autoexec"
        start = [bpy.app.binary_path, "--background", "--factory-startup", scripts, "--python-exit-code", "1"]
        return [*start, "--python", str(WORKER), "--"]

    def apply(self) -> bpy.types.Action:
        """Make an action of the worker's answer, which gets more warnings; return the action."""
        (scene, armature), answer = objects_of(self.names), self.answer
        if armature.data.bones.keys() != self.bones:
            raise SettingsError(f"{armature.name!r} has other bones than before; retarget again")
        names, matrices, on_joints = answer["names"], answer["matrices"], self.keys == "JOINTS"
        times = self.start + np.arange(len(matrices)) * answer["frame_time"] / frame_time_of(scene)
        muted = mute_others(armature, names if on_joints else ())
        transforms = poses_of(armature, names, matrices)[1] if on_joints else answer["transforms"]
        action = keyed(armature, self.title, times, transforms, answer.get("switches", ()))
        lines = answer.get("lines", [])
        if muted:
            more = f" and {len(muted) - 1} more" if len(muted) > 1 else ""
            back = "keys on controls or undo bring" if on_joints else "undo brings"
            lines.append(f"muted, since they move bones too: {muted[0]!r}{more}; {back} them back")
        reason = "may move and carry the character with it; clear that parent, constraint or driver"
        lines += [f"{name!r} {reason}" for name in carriers(armature)]
        answer["warnings"] += [(line, None) for line in lines]
        return action
