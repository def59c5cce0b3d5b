# SPDX-License-Identifier: GPL-3.0-or-later
"""The process that retargets a clip to a character: worker.py FOLDER.

FOLDER has `job`, a pickled dict that `job.Job` makes. The process writes its progress to `progress`, and at the end
`answer`, a pickled dict: an "error"; or "names", (joints,), "matrices", (frames, joints, 4, 4), with world positions
and rotations from the rest pose, "frame_time" [s], and the data that the panel shows. With keys on controls, Blender
runs this, and the answer also has the items that `controls.solve` returns.
"""

import json
import pickle
import re
import sys
import types
from contextlib import suppress
from pathlib import Path

import numpy as np

RIGID = 1e-5  # translations that change less than this count as constant [of the body]


def main(folder: Path) -> None:
    """Carry out the job in a folder."""
    job = pickle.loads((folder / "job").read_bytes())
    sys.path += job["path"]
    from distretarget import DistretargetError

    try:
        answer = _retargeted(job, folder / "progress")
        if job["keys"] != "JOINTS":
            answer |= _on_controls(job, answer, folder)
    except DistretargetError as error:
        answer = {"error": str(error)}
    (folder / "answer").write_bytes(pickle.dumps(answer))


class _Progress:
    """Writes the share of finished frames to a file."""

    def __init__(self, file: Path, title: str, frames: int) -> None:
        self.file, self.title, self.frames, self.done = file, title, max(frames, 1), 0

    def __call__(self, frames: float) -> None:
        self.done += frames
        self.file.write_text(f"{self.title}: {100 * min(self.done / self.frames, 1.0):.0f} %", "utf-8")


def _retargeted(job: dict, progress: Path) -> dict:
    from scipy.spatial.transform import Rotation

    from distretarget import Builds, DistretargetError, Edits, OutputSettings, contacts_to_json, read_motion, retarget
    from distretarget.io.contacts_file import HEADER, parse_contacts
    from distretarget.io.input_file import load_file
    from distretarget.io.reading import build_of, with_source
    from distretarget.pipeline.found_contacts import contacts_of

    builds = Builds()
    if job["clip"] is None:
        motion = _motion(job["performer"])
        with suppress(DistretargetError):  # the armature has no mesh
            builds = Builds(source=build_of(_target(job["performer"]), "the armature"))
    else:
        motion = read_motion(job["clip"], clip=job["animation"] or None)
        builds = with_source(builds, load_file(job["clip"]))
    motion, target = Edits(**job["edits"]).of(motion), _target(job["character"])
    keys = {*motion.skeleton.keys}
    missing = {joint: source for joint, source in job["map"].items() if source is not None and source not in keys}
    result = retarget(
        motion,
        target,
        builds=builds,
        joint_map={joint: source for joint, source in job["map"].items() if joint not in missing},
        contacts=parse_contacts(json.dumps(HEADER | {"contacts": job["contacts"]}), "Contacts"),
        progress=_Progress(progress, "Retargeting", len(motion)),
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
    progress = _Progress(folder / "progress", "Moving the controls", len(answer["matrices"]))
    return solve(armature, answer["names"], answer["matrices"], job["keys"], progress)


def _skeleton(arrays: dict[str, np.ndarray]):
    """The skeleton of an armature."""
    from distretarget import Skeleton
    from distretarget.skeleton import DEFAULT_ROOT, DEFAULT_ROTATIONS

    heads, parents = arrays["heads"], arrays["parents"]
    return Skeleton(
        names=tuple(arrays["names"]),
        parents=parents,
        offsets=heads - np.where((parents >= 0)[:, None], heads[parents], 0.0),
        channels=(DEFAULT_ROOT, *[DEFAULT_ROTATIONS] * (len(parents) - 1)),
        end_sites=np.zeros(len(parents), bool),
        up="Z",
        floor_at_zero=True,
    )


def _motion(arrays: dict[str, np.ndarray]):
    """The motion of an armature, whose bones may have changing translations."""
    from scipy.spatial.transform import Rotation

    from distretarget import Motion
    from distretarget.body.single_bones import on_ends
    from distretarget.numerics.kinematics import make_local

    skeleton, rotations, positions = _skeleton(arrays), arrays["rotations"], arrays["positions"]
    parents = np.maximum(skeleton.parents, 0)
    translations = Rotation.from_quat(rotations[:, parents]).inv().apply(positions - positions[:, parents])
    rigid = np.abs(translations - skeleton.offsets).max(axis=(0, 2)) < RIGID * np.ptp(arrays["heads"])
    translations = np.where(rigid[:, None], skeleton.offsets, translations)
    translations[:, 0] = positions[:, 0]
    make_local(skeleton.parents, rotations)
    motion = Motion.of_translations(skeleton, translations, rotations, repr(arrays["frame_time"]))
    return on_ends(motion, lambda: _mesh(arrays))


def _target(arrays: dict[str, np.ndarray]):
    """The character as a target."""
    from distretarget import Target
    from distretarget.body.single_bones import with_ends

    mesh = _mesh(arrays)
    return Target(with_ends(_skeleton(arrays), lambda: mesh), {}, "", mesh=lambda: mesh)


def _mesh(arrays: dict[str, np.ndarray]):
    """The skinned meshes of an armature as one, or None."""
    from distretarget.io.fbx import influences_of
    from distretarget.skin.mesh import SkinnedMesh

    influences = [arrays[name] for name in ("influenced", "influencing", "weights")]
    if not len(influences[0]):
        return None
    joints, weights = influences_of(len(arrays["vertices"]), *influences)
    bound = weights.sum(axis=1) > 0.0
    weights[~bound, 0] = 1.0  # vertices without a bone move with the root
    weights /= weights.sum(axis=1, keepdims=True)
    triangles = arrays["triangles"][bound[arrays["triangles"]].all(axis=1)]
    return SkinnedMesh(arrays["vertices"] - arrays["heads"][0], joints, weights, triangles)


if __name__ == "__main__":
    main(Path(sys.argv[-1]))
