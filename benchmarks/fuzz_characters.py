"""Characters with faults, through the readers and writers of glTF and BVH."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

sys.path += [str(Path(__file__).resolve().parents[1] / folder) for folder in ("tests", "tools")]
import gltf_player
from bodies import SAMPLES
from characters import chunks
from fuzz_outcomes import Memory, NotReadBackError, check_close, no_line, read_back
from mutated_gltf import mutated

from distretarget import DistretargetError, Motion, load_target, read_bvh, read_motion, retarget, write_motion
from distretarget.io.bvh import MAX_DEPTH, parse_bvh
from distretarget.io.bvh_writer import bvh_parts
from distretarget.io.reading import CharacterTarget

# Memory limit of a file: ten times its size, and that of 1,000,000 poses, which two keys far apart may need [bytes].
FREE_MEMORY, PER_BYTE = 128 * 2**20, 10
OFF = 1e-5  # tolerance of positions that are read back [of the extent of body, path and nodes]


@cache
def sample() -> Motion:
    """Three frames of a clip, after a first run that fills the package's caches."""
    motion = read_bvh(SAMPLES / "clap.bvh")[:3]
    retarget(motion, motion.skeleton)
    return motion


def through(seed: int) -> None:
    """Use the file of a seed as a target, and as a motion; raise a DistretargetError of either at the end."""
    sample()
    suffix, content = mutated(seed)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"hero{suffix}"
        path.write_bytes(content)
        memory = Memory()
        refused = [error for error in (_refusal(path, step) for step in (_as_target, _as_motion)) if error]
        memory.check(FREE_MEMORY + PER_BYTE * len(content))
    if refused:
        raise refused[0]


def _refusal(path: Path, step: Callable[[Path], None]) -> DistretargetError | None:
    """The DistretargetError of a step, which must name the file; None without one, or if there is no animation."""
    try:
        step(path)
    except DistretargetError as error:
        line = str(error)
        if fault := no_line(line) or ("" if path.parent.name in line else f"does not name the file: {line[:300]!r}"):
            raise RuntimeError(fault) from error
        return None if "has no animation" in line else error
    return None


def _as_motion(path: Path) -> None:
    """Write a motion as BVH and read it again, unless it is too deep a tree for BVH."""
    motion = read_motion(path)
    _check_finite(motion)
    if motion.skeleton.path_sizes(np.arange(len(motion.skeleton)))[0].max() - 1 > MAX_DEPTH:
        return
    text = read_back(lambda: "".join(bvh_parts(motion)))
    read = read_back(lambda: parse_bvh(text, "out.bvh"))
    motion = motion.turned_round() if motion.skeleton.faces_negative_z else motion  # as it is written
    if not _is_collapsed(motion):
        places = motion.positions[:, list(motion.skeleton.depth_first)]
        check_close(places, read.positions, _off(motion), "positions of the BVH")


def _as_target(path: Path) -> None:
    target = load_target(path)
    if not isinstance(target, CharacterTarget):
        raise NotReadBackError(f"no character: {target!r}")
    try:
        motion = retarget(sample(), target).motion
    except DistretargetError as error:  # joints that do not match are no fault of the file
        if fault := no_line(str(error)):
            raise RuntimeError(fault) from error
        return
    _check_finite(motion)
    out = path.with_name(f"out{path.suffix.replace('.vrma', '.glb')}")
    write_motion(out, motion, path, name="the new one", overwrite=True)
    read = read_back(lambda: read_motion(out, clip="the new one"))
    off = _off(motion, float(np.abs(target.character.shown.translations).max()))
    check_close(motion.positions, read.positions, off, "positions of the animation written")
    if not target.character.warnings and len(target.character.nodes) < 300 and out.suffix != ".gltf":
        times = sample().frame_time * np.arange(len(motion))
        placed = gltf_player.worlds(*chunks(out.read_bytes()), "the new one", times.astype("f4"))
        places = placed[:, target.character.joint_nodes][..., :3, 3]
        check_close(motion.positions, places, off, "positions of the animation played")


def _is_collapsed(motion: Motion) -> bool:
    """Whether bones have shrunk to nothing, which the reader of BVH takes for noise; see `bvh.add_offsets`."""
    if motion.moving is None:
        return False
    sizes = np.linalg.norm(motion.moving.translations, axis=2).max(axis=0)
    return bool((sizes < 0.02 * motion.skeleton.lengths[motion.moving.joints]).any())


def _check_finite(motion: Motion) -> None:
    if not np.isfinite(motion.positions).all() or not np.isfinite(motion.skeleton.offsets).all():
        raise NotReadBackError("positions are not finite")


def _off(motion: Motion, nodes: float = 0.0) -> float:
    body = float(np.abs(motion.positions).max(initial=0.0) + np.abs(motion.skeleton.offsets).max(initial=0.0))
    return OFF * (body + nodes) + 2e-6
