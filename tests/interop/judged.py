"""Files as the program writes them, and how far other readers find joints from where the program has them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from bodies import SAMPLES

from distretarget import Motion, load_target, read_bvh, retarget, write_bvh
from distretarget.body.body import Body
from interop.readers import Reader

FRAMES = 8  # frames that are compared
CASES = {  # by name, the clip and the target of each file
    "clap on long arms": ("clap.bvh", "long_arms.json"),
    "walk on a child": ("walk.bvh", "child.json"),
    "cartwheel on a giant": ("supports/cartwheel.bvh", "giant.json"),
    "turn on Mixamo's rig": ("turn.bvh", "rigs/mixamo_t.json"),
    "squat on Xsens's rig": ("squat.bvh", "rigs/xsens_a.json"),
    "wave on LAFAN1's rig": ("wave.bvh", "rigs/lafan1_a.json"),
}


def written(case: str, folder: Path) -> tuple[Path, Motion]:
    """Write the result of a case without namespaces, and return the file and what this package reads from it."""
    clip, target = CASES[case]
    source = read_bvh(SAMPLES / clip)
    start = source[:FRAMES]
    motion = retarget(start, load_target(SAMPLES / target)).motion
    path = folder / "out.bvh"
    write_bvh(path, replace(motion, skeleton=motion.skeleton.without_namespaces), overwrite=True)
    return path, read_bvh(path)


def farthest(reader: Reader, path: Path, motion: Motion) -> float:
    """How far a reader finds any joint from where this package has it [heights of the body]."""
    places = reader.read(path, len(motion))
    skeleton = motion.skeleton
    joints = [joint for joint in skeleton.joints if not skeleton.end_sites[joint]]
    found = np.stack([places[skeleton.names[joint]] for joint in joints], axis=1)
    away = np.linalg.norm(found - motion.positions[:, joints], axis=-1)
    return float(away.max() / Body.of(skeleton).height)
