# SPDX-License-Identifier: GPL-3.0-or-later
"""Retarget a clip onto a character in a process of its own, which holds nothing of Blender.

python worker.py FOLDER

FOLDER has `character.npz`, as `rig.arrays_of` returns it, and `job.json`: "clip", the path of the clip, or none
where `performer.npz` has its motion, as `rig.motion_of` returns it, and its meshes, as `rig.arrays_of` does; its
"animation", "edits" for `distretarget.Edits`, "in_place", the "contacts" of a contact
file, a "map" of joints, and the "frame_time" of the result, or none for that of the clip. It gets `result.npz`: what
`keys.Result` holds; and `result.json`: an error, or the verdict and the warnings, the contacts that were found, the
pairs of joints, and all joints, the "frames" and the "frame_time" of the clip.
"""

import json
import re
import sys
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

import numpy as np

RIGID = 1e-5  # a bone whose length and direction change less than this does not slide [of the body]


def main(folder: Path) -> None:
    """Do the job in a folder."""
    from distretarget.errors import DistretargetError

    job, arrays = json.loads((folder / "job.json").read_text("utf-8")), dict(np.load(folder / "character.npz"))
    try:
        told = _retargeted(job, arrays, folder)
    except DistretargetError as error:
        told = {"error": str(error)}
    (folder / "result.json").write_text(json.dumps(told), "utf-8")


def _retargeted(job: dict, arrays: dict[str, np.ndarray], folder: Path) -> dict:
    from scipy.spatial.transform import Rotation

    from distretarget import Edits, OutputSettings, contacts_to_json, read_motion, retarget
    from distretarget.io.contacts_file import HEADER, parse_contacts
    from distretarget.pipeline.found_contacts import contacts_of

    performer = dict(np.load(folder / "performer.npz")) if job["clip"] is None else {}
    motion = _motion(performer) if performer else read_motion(job["clip"], clip=job["animation"] or None)
    motion = Edits(**job["edits"]).of(motion)
    target, there = _target(arrays), {*motion.skeleton.keys}
    pairs = {joint: source for joint, source in job["map"].items() if source is None or source in there}
    asked = parse_contacts(json.dumps(HEADER | {"contacts": job["contacts"]}), "Contacts")
    with (folder / "progress").open("ab", buffering=0) as progress:
        told = _Told(progress, len(motion))
        builds = _builds(job["clip"], performer)
        result = retarget(motion, target, builds=builds, joint_map=pairs, contacts=asked, progress=told)
    moved = OutputSettings(in_place=job["in_place"]).clip(result.motion, "", np.array([0.0, 0.0, 1.0])).motion
    if job["frame_time"]:
        moved = moved.resampled(repr(job["frame_time"]))
    matrices = np.tile(np.eye(4), (*moved.positions.shape[:2], 1, 1))
    matrices[..., :3, :3] = Rotation.from_quat(moved.world_rotations).as_matrix()
    matrices[..., :3, 3] = moved.positions
    np.savez(folder / "result.npz", names=moved.skeleton.names, matrices=matrices, frame_time=moved.frame_time)
    numbers = {text: re.search(r"\bframe (\d+)", text) for text in result.warnings}
    gone = [(joint, source) for joint, source in job["map"].items() if source is not None and source not in there]
    matching = result.matching
    names, sources = matching.target.skeleton.keys, matching.source.skeleton
    return {
        "verdict": result.verdict,
        "warnings": [
            *result.warnings,
            *(f"this clip has no joint {source!r}, which was chosen for {joint!r}" for joint, source in gone),
        ],
        "flags": [[int(number[1]), text] for text, number in numbers.items() if number],
        "contacts": json.loads(contacts_to_json(contacts_of(result.baseline)))["contacts"],
        "pairs": [
            [name, sources.keys[one] if one >= 0 else ""] for name, one in zip(names, matching.drivers, strict=True)
        ],
        "joints": [sources.keys[joint] for joint in sources.joints],
        "frames": len(motion),
        "frame_time": motion.frame_time,
    }


class _Told:
    """Adds a character to a file for each percent of frames that are solved."""

    def __init__(self, file: BinaryIO, frames: int) -> None:
        self.file, self.frames, self.done = file, max(frames, 1), 0

    def __call__(self, frames: int) -> None:
        before, self.done = self.done, min(self.done + frames, self.frames)
        self.file.write(b"." * (100 * self.done // self.frames - 100 * before // self.frames))


def _skeleton(arrays: dict[str, np.ndarray]):
    """The skeleton of an armature."""
    from distretarget import Skeleton

    heads, parents = arrays["heads"], arrays["parents"]
    turning = ("Zrotation", "Xrotation", "Yrotation")
    return Skeleton(
        names=tuple(arrays["names"].tolist()),
        parents=parents,
        offsets=heads - np.where((parents >= 0)[:, None], heads[parents], 0.0),
        channels=(("Xposition", "Yposition", "Zposition", *turning), *[turning] * (len(parents) - 1)),
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
    return Motion.of_translations(skeleton, moved, turns, repr(float(arrays["frame_time"])))


def _builds(clip: str | None, performer: dict[str, np.ndarray]):
    """The builds of source and target: that of the source as its own mesh shows it."""
    from distretarget import Builds, DistretargetError
    from distretarget.io.input_file import load_file
    from distretarget.io.target_file import build_of, with_source

    if clip is not None:
        return with_source(Builds(), load_file(clip))
    with suppress(DistretargetError):
        return Builds(source=build_of(_target(performer), "the armature"))
    return Builds()


def _target(arrays: dict[str, np.ndarray]):
    """The character as a target."""
    from distretarget import Target
    from distretarget.skin.mesh import SkinnedMesh

    skeleton, heads = _skeleton(arrays), arrays["heads"]
    if not len(arrays.get("moved", ())):
        return Target(skeleton, {}, "")
    moved = arrays["moved"]  # in ascending order
    rank = np.arange(len(moved)) - np.searchsorted(moved, moved)
    shares = np.zeros((len(arrays["vertices"]), rank.max() + 1))
    joints = np.zeros(shares.shape, int)
    joints[moved, rank], shares[moved, rank] = arrays["movers"], arrays["weights"]
    bound = shares.sum(axis=1) > 0.0
    shares[~bound, 0] = 1.0  # what no bone moves stays with the root
    shares /= shares.sum(axis=1, keepdims=True)
    triangles = arrays["triangles"]
    mesh = SkinnedMesh(arrays["vertices"] - heads[0], joints, shares, triangles[bound[triangles].all(axis=1)])
    return Target(skeleton, {}, "", mesh=lambda: mesh)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
