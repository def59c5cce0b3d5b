# SPDX-License-Identifier: GPL-3.0-or-later
"""Retarget a clip onto a character in a process of its own: worker.py FOLDER.

FOLDER has `job`, a pickled dict that `job.Job` makes. The process writes into `progress` how far it is, and in the end
`answer`, a pickled dict: an "error"; or "names", (joints,), "matrices", (frames, joints, 4, 4), from the rest pose
without its places to the world, "frame_time" [s], and what the panel shows. With keys on controls it is Blender that
runs it, and the answer has what `controls.solve` returns, too.
"""

import json
import pickle
import re
import sys
import types
from contextlib import suppress
from pathlib import Path

import numpy as np

RIGID = 1e-5  # a bone whose length and direction change less than this does not slide [of the body]


def main(folder: Path) -> None:
    """Do the job in a folder."""
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
    """Says in a file how many of some frames are done."""

    def __init__(self, file: Path, what: str, frames: int) -> None:
        self.file, self.what, self.frames, self.done = file, what, max(frames, 1), 0

    def __call__(self, frames: float) -> None:
        self.done += frames
        self.file.write_text(f"{self.what}: {100 * min(self.done / self.frames, 1.0):.0f} %", "utf-8")


def _retargeted(job: dict, progress: Path) -> dict:
    from scipy.spatial.transform import Rotation

    from distretarget import Builds, DistretargetError, Edits, OutputSettings, contacts_to_json, read_motion, retarget
    from distretarget.io.contacts_file import HEADER, parse_contacts
    from distretarget.io.input_file import load_file
    from distretarget.io.target_file import build_of, with_source
    from distretarget.pipeline.found_contacts import contacts_of

    builds = Builds()
    if job["clip"] is None:
        motion = _motion(job["performer"])
        with suppress(DistretargetError):  # it has no mesh
            builds = Builds(source=build_of(_target(job["performer"]), "the armature"))
    else:
        motion = read_motion(job["clip"], clip=job["animation"] or None)
        builds = with_source(builds, load_file(job["clip"]))
    motion, target = Edits(**job["edits"]).of(motion), _target(job["character"])
    there = {*motion.skeleton.keys}
    gone = {joint: source for joint, source in job["map"].items() if source is not None and source not in there}
    result = retarget(
        motion,
        target,
        builds=builds,
        joint_map={joint: source for joint, source in job["map"].items() if joint not in gone},
        contacts=parse_contacts(json.dumps(HEADER | {"contacts": job["contacts"]}), "Contacts"),
        progress=_Progress(progress, "Retargeting", len(motion)),
    )
    moved = OutputSettings(in_place=job["in_place"]).clip(result.motion, "", np.array([0.0, 0.0, 1.0])).motion
    if job["frame_time"]:
        moved = moved.resampled(repr(job["frame_time"]))
    matrices = np.tile(np.eye(4), (*moved.positions.shape[:2], 1, 1))
    matrices[..., :3, :3] = Rotation.from_quat(moved.world_rotations).as_matrix()
    matrices[..., :3, 3] = moved.positions
    numbers = {text: re.search(r"\bframe (\d+)", text) for text in result.warnings}
    names, sources = result.matching.target.skeleton.keys, result.matching.source.skeleton
    drivers = [sources.keys[one] if one >= 0 else "" for one in result.matching.drivers]
    return {
        "names": moved.skeleton.names,
        "matrices": matrices,
        "frame_time": moved.frame_time,
        "verdict": result.verdict,
        "warnings": [
            *((text, int(number[1]) if number else None) for text, number in numbers.items()),
            *((f"this clip has no joint {gone[joint]!r}, which was chosen for {joint!r}", None) for joint in gone),
        ],
        "contacts": json.loads(contacts_to_json(contacts_of(result.baseline)))["contacts"],
        "pairs": [*zip(names, drivers, strict=True)],
        "joints": [sources.keys[joint] for joint in sources.joints],
        "clip": (len(motion), motion.frame_time),
    }


def _on_controls(job: dict, answer: dict, folder: Path) -> dict:
    """What `controls.solve` returns for the armature in `character.blend`."""
    import bpy

    extension = sys.modules["extension"] = types.ModuleType("extension")
    extension.__path__ = [str(Path(__file__).parent)]
    from extension.controls import solve

    with bpy.data.libraries.load(str(folder / "character.blend")) as (_, wanted):
        wanted.objects = [job["armature"]]
    (armature,) = wanted.objects
    armature.hide_viewport = False
    bpy.context.scene.collection.objects.link(armature)
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
    )


def _motion(arrays: dict[str, np.ndarray]):
    """The motion of an armature, whose bones may slide."""
    from scipy.spatial.transform import Rotation

    from distretarget import Motion
    from distretarget.numerics.kinematics import make_local

    skeleton, turns, places = _skeleton(arrays), arrays["turns"], arrays["places"]
    above = np.maximum(skeleton.parents, 0)
    moved = Rotation.from_quat(turns[:, above]).inv().apply(places - places[:, above])
    rigid = np.abs(moved - skeleton.offsets).max(axis=(0, 2)) < RIGID * np.ptp(arrays["heads"])
    moved = np.where(rigid[:, None], skeleton.offsets, moved)
    moved[:, 0] = places[:, 0]
    make_local(skeleton.parents, turns)
    return Motion.of_translations(skeleton, moved, turns, repr(arrays["frame_time"]))


def _target(arrays: dict[str, np.ndarray]):
    """The character as a target."""
    from distretarget import Target
    from distretarget.skin.mesh import SkinnedMesh

    skeleton, moved = _skeleton(arrays), arrays["moved"]
    if not len(moved):
        return Target(skeleton, {}, "")
    rank = np.arange(len(moved)) - np.searchsorted(moved, moved)
    weights = np.zeros((len(arrays["vertices"]), rank.max() + 1))
    joints = np.zeros(weights.shape, int)
    joints[moved, rank], weights[moved, rank] = arrays["movers"], arrays["weights"]
    bound = weights.sum(axis=1) > 0.0
    weights[~bound, 0] = 1.0  # what no bone moves stays with the root
    weights /= weights.sum(axis=1, keepdims=True)
    triangles = arrays["triangles"][bound[arrays["triangles"]].all(axis=1)]
    mesh = SkinnedMesh(arrays["vertices"] - arrays["heads"][0], joints, weights, triangles)
    return Target(skeleton, {}, "", mesh=lambda: mesh)


if __name__ == "__main__":
    main(Path(sys.argv[-1]))
