# SPDX-License-Identifier: GPL-3.0-or-later
"""The process that retargets a clip to a character: worker.py FOLDER.

FOLDER has `job`: where to import from, and a dict that `job.Job` makes, both pickled. The process writes its progress
to `progress`, and at the end `answer`, a pickled dict: an "error"; or "names", (joints,), "matrices", (frames, joints,
4, 4), with world positions and rotations from the rest pose, "frame_time" [s], and the data that the panel shows. With
keys on controls, Blender runs this, and the answer also has the items that `controls.solve` returns.
"""

import json
import pickle
import re
import sys
import types
from contextlib import suppress
from pathlib import Path

import numpy as np


def main(folder: Path) -> None:
    """Carry out the job in a folder."""
    with (folder / "job").open("rb") as file:
        sys.path += pickle.load(file)
        job = pickle.load(file)
    from distretarget import DistretargetError

    try:
        answer = _retargeted(job, folder)
        if job["keys"] != "JOINTS":
            answer |= _on_controls(job, answer, folder)
    except DistretargetError as error:
        answer = {"error": str(error)}
    (folder / "answer").write_bytes(pickle.dumps(answer))


class _Progress:
    """Writes the share of finished frames to a file."""

    def __init__(self, folder: Path, title: str, frames: int) -> None:
        self.file, self.title, self.frames, self.done = folder / "progress", title, frames, 0.0

    def __call__(self, frames: float) -> None:
        self.done += frames
        self.file.write_text(f"{self.title}: {100 * min(self.done / self.frames, 1.0):.0f} %", "utf-8")


def _retargeted(job: dict, folder: Path) -> dict:
    from scipy.spatial.transform import Rotation

    from distretarget import Builds, DistretargetError, Edits, OutputSettings, contacts_to_json, read_motion, retarget
    from distretarget.body.single_bones import on_ends
    from distretarget.io.contacts_file import HEADER, parse_contacts
    from distretarget.io.input_file import load_file
    from distretarget.io.reading import build_of, with_source
    from distretarget.pipeline.found_contacts import contacts_of

    builds = Builds()
    if job["clip"] is None:
        motion, mesh = job["performer"]
        with suppress(DistretargetError):  # the armature has no mesh
            builds = Builds(source=build_of(_target(motion.skeleton, mesh), "the armature"))
        motion = on_ends(motion, lambda: mesh)
    else:
        motion = read_motion(job["clip"], clip=job["animation"] or None)
        builds = with_source(builds, load_file(job["clip"]))
    motion, target = Edits(**job["edits"]).of(motion), _target(*job["character"])
    keys = {*motion.skeleton.keys}
    missing = {joint: source for joint, source in job["map"].items() if source is not None and source not in keys}
    result = retarget(
        motion,
        target,
        builds=builds,
        joint_map={joint: source for joint, source in job["map"].items() if joint not in missing},
        contacts=parse_contacts(json.dumps(HEADER | {"contacts": job["contacts"]}), "Contacts"),
        progress=_Progress(folder, "Retargeting", len(motion)),
    )
    written = OutputSettings(in_place=job["in_place"]).clip(result.motion, "", np.array([0.0, 0.0, 1.0])).motion
    if job["frame_time"]:
        written = written.resampled(repr(job["frame_time"]))
    matrices = np.tile(np.eye(4), (*written.positions.shape[:2], 1, 1))
    matrices[..., :3, :3] = Rotation.from_quat(written.world_rotations).as_matrix()
    matrices[..., :3, 3] = written.positions
    numbers = {text: re.search(r"\bframe (\d+)", text) for text in result.warnings}
    bones, sources = result.matching.target.skeleton, result.matching.source.skeleton
    drivers = [(joint, result.matching.drivers[joint]) for joint in bones.joints]
    return {
        "names": written.skeleton.names,
        "matrices": matrices,
        "frame_time": written.frame_time,
        "verdict": result.verdict,
        "warnings": [
            *((text, int(number[1]) if number else None) for text, number in numbers.items()),
            *((f"this clip has no joint {missing[each]!r}, which was chosen for {each!r}", None) for each in missing),
        ],
        "contacts": json.loads(contacts_to_json(contacts_of(result.baseline)))["contacts"],
        "pairs": [(bones.keys[joint], sources.keys[one] if one >= 0 else "") for joint, one in drivers],
        "joints": [sources.keys[joint] for joint in sources.joints],
        "clip": (len(motion), motion.frame_time),
    }


def _on_controls(job: dict, answer: dict, folder: Path) -> dict:
    """The result of `controls.solve` for the armature in `character.blend`."""
    import bpy

    extension = sys.modules["extension"] = types.ModuleType("extension")
    extension.__path__ = [str(Path(__file__).parent)]
    from extension.controls import solve
    from extension.rig import unmute

    with bpy.data.libraries.load(str(folder / "character.blend")) as (_, wanted):
        wanted.objects = [job["armature"]]
    (armature,) = wanted.objects
    armature.hide_viewport = False
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.scene.frame_set(job["frame"])  # puts it where it is in the world
    unmute(armature, job["muted"])
    progress = _Progress(folder, "Moving the controls", len(answer["matrices"]))
    return solve(armature, answer["names"], answer["matrices"], job["keys"], progress)


def _target(skeleton, mesh):
    """A character as a target."""
    from distretarget import Target
    from distretarget.body.single_bones import with_ends

    return Target(with_ends(skeleton, lambda: mesh), {}, "", mesh=lambda: mesh)


if __name__ == "__main__":
    main(Path(sys.argv[-1]))
