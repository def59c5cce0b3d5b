"""Put clips on all characters in a folder, as GLB, glTF, VRM and VRM animations, for other programs to play.

    python benchmarks/onto_characters.py CHARACTERS OUT [CLIP...]
    DISTRETARGET_NODE=PACKAGES DISTRETARGET_BLENDER=PYTHON python benchmarks/play.py OUT

Beside each file, an npz says where the result has the joints, as `benchmarks/play.py` reads it. A line for each says
how many joints have a counterpart, the metrics of contact and direction, and the warnings.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np

from distretarget import RetargetResult, read_bvh, retarget, write_motion
from distretarget.io.input_file import load_file
from distretarget.io.target_file import CharacterTarget, TargetFile

SAMPLES = Path(__file__).resolve().parents[1] / "sample_bvh"
CLIPS = [SAMPLES / f"{name}.bvh" for name in ("walk", "clap", "hands_on_hips")]
ENDINGS = (".glb", ".gltf", ".vrm", ".fbx")


def write(out: Path, source: Path, clip: str, result: RetargetResult, target: CharacterTarget) -> None:
    """Write a result in each way that the character's kind allows, and beside it what should be seen."""
    motion, character = result.motion, target.character
    is_fbx = source.suffix == ".fbx"
    path = out / f"{source.stem}_{clip}{'.bvh' if is_fbx else source.suffix}"
    write_motion(path, motion, source, name=clip, overwrite=True)
    if is_fbx:
        return
    nodes = character.joint_nodes
    times = motion.frame_time * np.arange(len(motion))
    seen = {"times": times, "animation": clip, "input": str(source.resolve())}
    np.savez(path.with_suffix(".npz"), nodes=nodes, positions=motion.positions, **seen)
    if motion.skeleton.humanoid:
        vrma = path.with_name(f"{path.stem}_alone.vrma")
        write_motion(vrma, motion, overwrite=True)
        vrm = vrma.with_suffix(".vrm")
        shutil.copyfile(source, vrm)
        bones = list(dict(motion.skeleton.humanoid).values())
        np.savez(
            vrma.with_suffix(".npz"),
            nodes=nodes[bones],
            times=times,
            positions=motion.positions[:, bones],
            animation=0,
            vrm=vrm.name,
        )


def main(characters: str, out: str, *clips: str) -> None:
    """Write all files."""
    Path(out).mkdir(parents=True, exist_ok=True)
    for source in sorted(path for path in Path(characters).iterdir() if path.suffix in ENDINGS):
        target = TargetFile.of(load_file(source)).target
        for clip in map(Path, clips or CLIPS):
            result = retarget(read_bvh(clip), target)
            write(Path(out), source, clip.stem, result, target)
            metrics, copy = result.metrics["result"], result.metrics["rotation_copy"]
            known = f"{np.sum(result.drivers >= 0)} of {len(result.drivers)} joints"
            contact = " / ".join(
                "-" if side["contact_error"] is None else f"{side['contact_error']:.4f}" for side in (metrics, copy)
            )
            print(f"{source.name} {clip.stem}: {known}; contact {contact}; direction {metrics['direction_error']:.2f}")
            for warning in (*target.character.warnings, *result.warnings):
                print(f"    {warning}")


if __name__ == "__main__":
    main(*sys.argv[1:])
