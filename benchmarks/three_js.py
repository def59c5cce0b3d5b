"""`SkeletonUtils.retargetClip` of three.js, run by node, on a target's bones."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from distretarget import Motion, RetargetResult, write_bvh

SCRIPT = Path(__file__).with_name("retarget_clip.mjs")
PACKAGES = "DISTRETARGET_NODE"  # names the folder in which npm has installed packages
STILL = np.array([0.0, 0.0, 0.0, 1.0])


def missing() -> str:
    """Why three.js cannot be run here; empty if it can."""
    if PACKAGES not in os.environ:
        return f"{PACKAGES} does not name a folder with the npm package three"
    if not _package().is_file():
        return f"the npm package three is not in {os.environ[PACKAGES]}"
    return "" if shutil.which("node") else "node.js is not installed"


def version() -> str:
    """The version of three.js."""
    return str(json.loads(_package().read_text())["version"])


def _package() -> Path:
    return Path(os.environ[PACKAGES]) / "node_modules" / "three" / "package.json"


@dataclass(frozen=True, eq=False)
class ThreeJs:
    """The clip of a run by three.js, with the run's pairs and scale; axes agree, so it needs no `localOffsets`."""

    run: RetargetResult

    def motion(self) -> Motion:
        """The result as a motion of the target."""
        return self.solve(1)[0]

    def solve(self, runs: int) -> tuple[Motion, NDArray[np.float64]]:
        """The result, and the seconds of processor time of each of some runs in one process."""
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "task.json"
            file.write_text(json.dumps(self._task(Path(folder) / "clip.bvh")))
            command = ["node", SCRIPT, Path(os.environ[PACKAGES]).resolve(), file, runs]
            done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=True)
        answer = json.loads(done.stdout.strip().splitlines()[-1])
        return self._motion(answer["tracks"]), np.array(answer["seconds"])

    @property
    def _hip(self) -> int:
        """The first joint of the target that the source drives."""
        return int(np.flatnonzero(self.run.drivers >= 0)[0])

    def _task(self, clip: Path) -> dict:
        """The task of the script; joints are named by number, as names of tracks may hold few characters."""
        source, target, drivers = self.run.source, self.run.motion.skeleton, self.run.drivers
        names = tuple(f"s{joint}" for joint in range(len(source.skeleton)))
        write_bvh(clip, replace(source, skeleton=replace(source.skeleton, names=names)))
        joints = np.array(target.joints)
        return {
            "bvh": clip.read_text(),
            "names": [f"t{joint}" for joint in joints],
            "parents": [int(np.searchsorted(joints, target.parents[joint])) for joint in joints],
            "offsets": target.offsets[joints].tolist(),
            "pairs": {f"t{joint}": f"s{drivers[joint]}" for joint in joints if drivers[joint] >= 0},
            "hip": f"s{drivers[self._hip]}",
            "scale": self.run.root_scale,
        }

    def _motion(self, tracks: list[dict]) -> Motion:
        copy = self.run.rotation_copy
        frames, joints = copy.rotations.shape[:2]
        rotations, translations = np.tile(STILL, (frames, joints, 1)), np.tile(copy.skeleton.offsets, (frames, 1, 1))
        for track in tracks:
            joint, moved = int(track["bone"][1:]), track["kind"] == "position"
            values = np.array(track["values"]).reshape(-1, 3 if moved else 4)
            if moved:
                translations[:, joint] = values
            else:
                rotations[:, joint] = values / np.linalg.norm(values, axis=1, keepdims=True)
        return Motion.of_translations(copy.skeleton, translations, rotations, copy.frame_time_text)
