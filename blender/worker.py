# SPDX-License-Identifier: GPL-3.0-or-later
"""Retarget a clip onto a character in a process of its own, which holds nothing of Blender.

python worker.py FOLDER

FOLDER has `character.npz`, as `rig.arrays_of` returns it, and `job.json`: "clip", the path of the clip, or none
where `performer.npz` has its motion, as `rig.motion_of` returns it, and its meshes, as `rig.arrays_of` does; its
"animation", "edits" and "options" for `distretarget.Edits` and `Options`, "in_place", the "contacts" of a contact
file, and a "map" of joints. It gets `result.npz`: `places`, (frames, joints, 3), `turns`, (frames, joints, 4),
rotations from the rest pose in the world, x y z w, and `frame_time`; and `result.json`: an error, or the verdict and
the warnings, the contacts that were found, the pairs of joints, and all joints of the clip.
"""

import json
import re
import sys
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

import numpy as np


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
    from distretarget import Edits, Options, OutputSettings, contacts_to_json, find_contacts, read_motion, retarget
    from distretarget.io.contacts_file import HEADER, parse_contacts

    performer = dict(np.load(folder / "performer.npz")) if job["clip"] is None else {}
    motion = _motion(performer) if performer else read_motion(job["clip"], clip=job["animation"] or None)
    motion = Edits(**job["edits"]).of(motion)
    target, there = _target(arrays), {*motion.skeleton.keys}
    pairs = {joint: source for joint, source in job["map"].items() if source is None or source in there}
    asked = parse_contacts(json.dumps(HEADER | {"contacts": job["contacts"]}), "Contacts")
    with (folder / "progress").open("ab", buffering=0) as progress:
        told = _Told(progress, len(motion))
        options, builds = Options(**job["options"]), _builds(job["clip"], performer)
        result = retarget(motion, target, options, builds=builds, joint_map=pairs, contacts=asked, progress=told)
    moved = OutputSettings(in_place=job["in_place"]).clip(result.motion, "", np.array([0.0, 0.0, 1.0])).motion
    np.savez(
        folder / "result.npz",
        places=moved.positions,
        turns=moved.world_rotations,
        frame_time=moved.frame_time,
    )
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
        "contacts": json.loads(contacts_to_json(find_contacts(motion, target, joint_map=pairs)))["contacts"],
        "pairs": [
            [name, sources.keys[one] if one >= 0 else ""] for name, one in zip(names, matching.drivers, strict=True)
        ],
        "joints": [sources.keys[joint] for joint in sources.joints],
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
    """The motion of an armature."""
    from scipy.spatial.transform import Rotation

    from distretarget import Motion

    skeleton, turns = _skeleton(arrays), arrays["turns"]
    above = np.where((skeleton.parents >= 0)[:, None], turns[:, skeleton.parents], [0.0, 0.0, 0.0, 1.0])
    local = Rotation.from_quat(above.reshape(-1, 4)).inv() * Rotation.from_quat(turns.reshape(-1, 4))
    rotations = local.as_quat().reshape(turns.shape)
    return Motion(skeleton, arrays["places"][:, 0], rotations, repr(float(arrays["frame_time"])))


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
    if not len(arrays.get("vertices", ())) or not len(arrays["moved"]):
        return Target(skeleton, {}, "")
    count, moved = len(arrays["vertices"]), arrays["moved"].astype(int)
    order = np.argsort(moved, kind="stable")
    moved, movers, weights = moved[order], arrays["movers"][order].astype(int), arrays["weights"][order]
    rank = np.arange(len(moved)) - np.searchsorted(moved, moved)
    joints, shares = np.zeros((count, rank.max() + 1), int), np.zeros((count, rank.max() + 1))
    joints[moved, rank], shares[moved, rank] = movers, weights
    bound = shares.sum(axis=1) > 0.0
    shares[~bound, 0] = 1.0  # what no bone moves stays with the root
    triangles = arrays["triangles"].astype(int)
    shares /= shares.sum(axis=1, keepdims=True)
    mesh = SkinnedMesh(arrays["vertices"] - heads[0], joints, shares, triangles[bound[triangles].all(axis=1)])
    return Target(skeleton, {}, "", mesh=lambda: mesh)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
