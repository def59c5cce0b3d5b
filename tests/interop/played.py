"""Files of characters with animations whose positions are known, and how far off other programs play them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from bodies import SAMPLES
from characters import (
    ARMATURE,
    LOOKING_BACK,
    Bones,
    Character,
    Performance,
    as_vrm0,
    as_vrm1,
    as_vrma,
    box_mesh,
    character,
    with_unknown_parts,
)

from distretarget import load_target, read_bvh, retarget, write_motion
from interop.players import Players

MOTION = read_bvh(SAMPLES / "walk.bvh")[:24]
BONES, WALK = Bones.of(MOTION.skeleton), Performance.of(MOTION)
ROLLED = BONES.along_bones(np.linspace(-2, 2, len(BONES.names)))
ODD = [
    "",
    "same",
    "same",
    "Left Upper Arm",
    "mixamorig:Neck",
    "a/b",
    "日本 語",
    "[x].y",
    "Bip001 L Thigh",
    ".",
    "same.001",
]
ODD_NAMES = {"Chest": "", "RightElbow": "a/b", "RightWrist": "日本 語", "LeftHip": "mixamorig:LeftUpLeg"}


@dataclass(frozen=True, eq=False)
class Expected:
    """Where nodes of a file should be: `nodes` (nodes,), `times` (frames,) [s], `positions` (frames, nodes, 3) [m]."""

    path: Path
    animation: int | str | None
    nodes: np.ndarray
    times: np.ndarray
    positions: np.ndarray
    vrma: Path | None = None

    def farthest(self, players: Players, program: str) -> float:
        """How far off a program plays any node in any frame [m]; NaN if it knows not all nodes."""
        found = players.play(program, self.path, self.animation, self.times, self.nodes, vrma=self.vrma)
        return float(np.linalg.norm(found - self.positions, axis=-1).max())


def _walking(
    folder: Path, made: Character, walk: Performance = WALK, name: str = "walk", ending: str = "glb", **options
):
    """The file of a character that walks, after another animation."""
    made.animate("another", walk[:3])
    number = made.animate(name, walk, **options)
    path = made.write(folder / f"character.{ending}")
    return Expected(path, number, np.array(made.joints), walk.times, walk.positions)


def _vrma(folder: Path) -> Expected:
    """A VRM animation on the VRM that it was made for, whose joints lie otherwise."""
    vrm = as_vrm1(character(BONES, axes=ROLLED))
    moving = as_vrma(character(BONES, above=ARMATURE, meshes=None))
    moving.animate("", WALK)
    path, vrma = vrm.write(folder / "character.vrm"), moving.write(folder / "walk.vrma")
    return Expected(path, 0, np.array(vrm.joints), WALK.times, WALK.positions, vrma)


def _late(folder: Path) -> Expected:
    """Keys that begin late and are unequally far apart."""
    times = 0.5 + np.cumsum(np.linspace(0.01, 0.1, len(WALK.times)))
    return _walking(folder, character(BONES, axes=ROLLED), Performance(WALK.turns, WALK.positions, times))


CASES: dict[str, Callable[[Path], Expected]] = {
    "plain": lambda folder: _walking(folder, character(BONES)),
    "armature in cm, rolled joints": lambda folder: _walking(
        folder, character(BONES, axes=ROLLED, above=ARMATURE, helpers=[3, 9])
    ),
    "odd names": lambda folder: _walking(
        folder, character(BONES.renamed([*ODD, *BONES.names[len(ODD) :]]), axes=ROLLED), name="a/b: c.001"
    ),
    "glTF, buffer beside": lambda folder: _walking(folder, character(BONES, axes=ROLLED), ending="gltf"),
    "two skins, scales": lambda folder: _walking(
        folder,
        character(
            BONES,
            axes=ROLLED,
            scales={0: 2.0, 3: 0.25},
            meshes=[box_mesh(BONES, range(11)), box_mesh(BONES, range(11, 22))],
            all_joints=False,
        ),
        scales=True,
        all_translations=True,
    ),
    "cubic": lambda folder: _walking(folder, character(BONES, axes=ROLLED), interpolation="CUBICSPLINE"),
    "sparse, signs flipped": lambda folder: _walking(
        folder, character(BONES, axes=ROLLED), sparse=True, flipped=True, still=False
    ),
    "keys that begin late": _late,
    "VRM 0": lambda folder: _walking(
        folder, as_vrm0(character(BONES.turned(LOOKING_BACK))), WALK.turned(LOOKING_BACK), ending="vrm"
    ),
    "VRM 1": lambda folder: _walking(
        folder, as_vrm1(with_unknown_parts(character(BONES, axes=ROLLED)), springs=["Neck"]), ending="vrm"
    ),
    "VRM animation": _vrma,
}


def _retargeted(folder: Path, clip: str, made: Character, ending: str, out: str) -> Expected:
    """A clip retargeted to a character that can sway already, and written as a file of the same kind, or as VRMA."""
    if not made.matrices:  # nodes with a matrix cannot be animated
        made.animate("sway", Performance.swaying(made.bones, 4), all_translations=True)
    hero, path = made.write(folder / f"hero{ending}"), folder / f"out{out}"
    target = load_target(hero)
    motion = retarget(read_bvh(SAMPLES / clip)[:FRAMES], target).motion
    write_motion(path, motion, hero)
    times, nodes = motion.frame_time * np.arange(len(motion)), target.character.nodes[-len(motion.skeleton) :]
    if out == ".vrma":
        return Expected(hero, 0, nodes, times, motion.positions, path)
    return Expected(path, "out", nodes, times, motion.positions)


FRAMES = 8  # of each written clip
WRITTEN: dict[str, Callable[[Path], Expected]] = {
    "clap on a GLB in cm": lambda folder: _retargeted(
        folder, "clap.bvh", character(BONES, axes=ROLLED, above=ARMATURE, helpers=[3, 9]), ".glb", ".glb"
    ),
    "cartwheel on odd names": lambda folder: _retargeted(
        folder,
        "supports/cartwheel.bvh",
        character(BONES.renamed({**ODD_NAMES, "LeftShoulder": "Left Upper Arm"}), matrices=True),
        ".glb",
        ".glb",
    ),
    "wave on a glTF": lambda folder: _retargeted(folder, "wave.bvh", character(BONES, axes=ROLLED), ".gltf", ".gltf"),
    "squat on a VRM 0": lambda folder: _retargeted(
        folder, "squat.bvh", as_vrm0(character(BONES.turned(LOOKING_BACK))), ".vrm", ".vrm"
    ),
    "walk on a VRM 1": lambda folder: _retargeted(
        folder,
        "walk.bvh",
        as_vrm1(with_unknown_parts(character(BONES, axes=ROLLED)), springs=["Neck"]),
        ".vrm",
        ".vrm",
    ),
    "turn as a VRM animation": lambda folder: _retargeted(
        folder, "turn.bvh", as_vrm1(character(BONES, axes=ROLLED)), ".vrm", ".vrma"
    ),
}


def plays(program: str, case: str) -> bool:
    """Whether a case is for a program: VRM files for three-vrm, and VRM animations for no other."""
    return ("VRM" in case) if program == "three-vrm" else "VRM animation" not in case
