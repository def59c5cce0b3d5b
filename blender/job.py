# SPDX-License-Identifier: GPL-3.0-or-later
"""A clip that is retargeted onto a character by processes of their own, so that Blender can be used meanwhile."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .contacts import acts, entries_of
from .keys import Result, keyed_controls, keyed_joints
from .rig import arrays_of, motion_of, others_on, title_of
from .settings import clip_key

ENDINGS = (".bvh", ".fbx", ".glb", ".gltf", ".vrm", ".vrma", ".npz")
HERE = Path(__file__).parent
LOOKS = 0.05  # a process is looked at so often [s]


class FailedError(Exception):
    """What a user is told in a line."""


def chosen_armature(context: bpy.types.Context) -> bpy.types.Object | None:
    """The active armature, or that of the active mesh."""
    chosen = context.active_object
    if chosen is not None and chosen.type == "MESH":
        chosen = chosen.find_armature()
    return chosen if chosen is not None and chosen.type == "ARMATURE" else None


def target_of(context: bpy.types.Context) -> bpy.types.Object:
    """The armature that was chosen, if a motion can be on it."""
    chosen = chosen_armature(context)
    if chosen is None:
        raise FailedError("select the armature of a character, or its mesh")
    if chosen.library is not None:
        raise FailedError(f"{chosen.name!r} is linked from another file; make it local or an override first")
    if not chosen.data.bones:
        raise FailedError(f"{chosen.name!r} has no bones")
    if min(chosen.matrix_world.to_scale()) <= 0.0 or np.ptp(chosen.matrix_world.to_scale()) > 1e-4:
        raise FailedError(f"{chosen.name!r} has an uneven scale; apply it with Ctrl+A")
    return chosen


def names_of(scene: bpy.types.Scene, armature: bpy.types.Object) -> tuple[str, str]:
    """By what both are found again: undo replaces everything in a file."""
    return scene.name, armature.name


def there(names: tuple[str, str]) -> tuple[bpy.types.Scene, bpy.types.Object]:
    """The scene and the armature with these names."""
    scene, armature = bpy.data.scenes.get(names[0]), bpy.data.objects.get(names[1])
    if scene is None or armature is None or armature.type != "ARMATURE":
        raise FailedError(f"{names[1]!r} or its scene is gone; the motion was dropped")
    return scene, armature


class Job:
    """A clip on its way to an armature."""

    def __init__(self, scene: bpy.types.Scene, armature: bpy.types.Object, clip: Path | bpy.types.Object) -> None:
        """`clip` is a file, or an armature of the scene that moves."""
        is_file = isinstance(clip, Path)
        if is_file and clip.suffix.lower() not in ENDINGS:
            raise FailedError(f"{clip.name or 'no file'}: expected a clip, {', '.join(ENDINGS)}")
        if is_file and not clip.is_file():
            raise FailedError(f"{clip}: there is no such file")
        if clip == armature:
            raise FailedError(f"{clip.name!r} is the character; choose another armature for the clip")
        if not is_file and not clip.data.bones:
            raise FailedError(f"{clip.name!r} has no bones")
        settings = scene.distretarget
        self.names, self.process = names_of(scene, armature), None
        self.title = clip.stem if is_file else title_of(clip)
        self.key = clip_key(clip, settings.animation) if is_file else self.title
        self.keys, self.start = settings.keys, settings.start
        self.bones = armature.data.bones.keys()
        self.place = tempfile.TemporaryDirectory(prefix="distretarget_")
        self.folder = Path(self.place.name)
        np.savez(self.folder / "character.npz", **arrays_of(armature))
        if not is_file:
            shape = arrays_of(clip) if clip.data.library is None else {}  # what is linked cannot be put at rest
            np.savez(self.folder / "performer.npz", **shape | motion_of(clip, scene))
        job = {
            "clip": str(clip.resolve()) if is_file else None,
            "animation": settings.animation,
            "edits": {"mirror": settings.mirror, "loop": settings.loop},
            "in_place": settings.in_place,
            "frame_time": scene.render.fps_base / scene.render.fps if settings.whole_frames else None,
            "contacts": [entry for entry in entries_of(scene, self.key) if acts(entry)],
            "map": {pair.name: pair.source or None for pair in armature.distretarget_pairs if pair.is_chosen},
            "armature": armature.name,
            "keys": self.keys,
        }
        (self.folder / "job.json").write_text(json.dumps(job), "utf-8")
        if self.keys != "JOINTS":
            bpy.data.libraries.write(str(self.folder / "character.blend"), {armature}, path_remap="ABSOLUTE")

    def done(self) -> Iterator[str]:
        """Yield how far it is, in words, until it is done."""
        retargeting = [sys.executable, str(HERE / "worker.py"), str(self.folder)]
        paths = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        yield from self._run("Retargeting", retargeting, "result.json", os.environ | paths)
        if self.keys != "JOINTS":
            solving = _blender(HERE / "solver.py", self.folder)
            yield from self._run("Moving the controls", solving, "controls.json", os.environ)

    def _run(self, what: str, command: list[str], answer: str, environment: Mapping[str, str]) -> Iterator[str]:
        """Run a process that adds a character to the file `progress` for each percent, until it answers."""
        progress, said = self.folder / "progress", self.folder / "said"
        progress.write_bytes(b"")
        with said.open("wb") as output:
            self.process = subprocess.Popen(command, env=environment, stdout=output, stderr=output)
        while self.process.poll() is None:
            yield f"{what}: {progress.stat().st_size} %"
        if self.process.returncode or not (self.folder / answer).is_file():
            lines = said.read_text("utf-8", "replace").split("\n")
            last = next((line.strip() for line in reversed(lines) if line.strip()), self.process.returncode)
            raise FailedError(f"{what} stopped: {last}; nothing is changed")
        self.told = json.loads((self.folder / answer).read_text("utf-8")) | getattr(self, "told", {})
        if "error" in self.told:
            raise FailedError(self.told["error"])

    def stop(self) -> None:
        """End its process, and leave nothing."""
        if self.process is not None:
            self.process.kill()
            self.process.wait()
        self.place.cleanup()

    def apply(self) -> tuple[bpy.types.Scene, bpy.types.Action, dict[str, Any]]:
        """Make an action of the result; return its scene, the action and what there is to say."""
        scene, armature = there(self.names)
        if armature.data.bones.keys() != self.bones:
            raise FailedError(f"{armature.name!r} has other bones than before; retarget again")
        result, told = Result.load(self.folder), self.told
        rate = scene.render.fps / scene.render.fps_base
        times = self.start + np.arange(len(result.matrices)) * result.frame_time * rate
        others = others_on(armature, result.names if self.keys == "JOINTS" else ())
        for _, each in others:
            each.mute = True
        if self.keys == "JOINTS":
            action = keyed_joints(armature, result, self.title, times)
        else:
            controls = np.load(self.folder / "controls.npz")
            action = keyed_controls(armature, controls, told["switches"], self.title, times)
            told["warnings"] += told["lines"]
        if names := [*dict.fromkeys(repr(name) for name, _ in others)]:
            more = f" and {len(names) - 1} more" if len(names) > 1 else ""
            told["warnings"].append(f"muted, since they move bones too: {names[0]}{more}; undo brings them back")
        for name in _carriers(armature):
            told["warnings"].append(f"{name!r} may move and carry the character with it; clear that parent")
        return scene, action, told | {"step": told["frame_time"] * rate}


def _carriers(armature: bpy.types.Object) -> Iterator[str]:
    """The names of what an armature hangs from that may move."""
    while (armature := armature.parent) is not None:
        if armature.animation_data is not None:
            yield armature.name


def _blender(script: Path, folder: Path) -> list[str]:
    """The command that runs a script in another Blender, without the user's settings."""
    if not bpy.app.binary_path:  # it is a module of Python
        return [sys.executable, str(script), str(folder)]
    scripts = "--disable-autoexec" if bpy.app.autoexec_fail else "--enable-autoexec"
    start = [bpy.app.binary_path, "--background", "--factory-startup", scripts, "--python-exit-code", "1"]
    return [*start, "--python", str(script), "--", str(folder)]
