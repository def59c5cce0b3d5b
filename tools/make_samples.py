"""Write `sample_characters`, and clips and props of `sample_bvh`, whose targets, rigs and scenes are edited by hand.

    python tools/make_samples.py [FOLDER]

With FOLDER, everything goes there. Every run writes the same bytes.
"""

from __future__ import annotations

import sys
from pathlib import Path

import sample_character
from sample_motions import CLIPS
from sample_scenes import SCENES, obj_text
from sample_supports import SUPPORTED

from distretarget import Motion, write_bvh

ROOT = Path(__file__).resolve().parents[1]
SAMPLES, CHARACTERS = ROOT / "sample_bvh", ROOT / "sample_characters"


def write_samples(folder: Path) -> None:
    """Write all clips into a folder, `supports`, and `scenes` with performers and props; files are replaced."""
    motions = {name: clip() for name, clip in CLIPS.items()}
    motions |= {f"supports/{name}": sample().motion for name, sample in SUPPORTED.items()}
    for scene_name, make_scene in SCENES.items():
        scene = make_scene()
        moving = {**scene.performers, **{prop.name: prop.motion for prop in scene.props}}
        motions |= {f"scenes/{scene_name}/{name}": motion for name, motion in moving.items()}
    for name, motion in motions.items():
        write(folder / name, motion)


def write_characters(folder: Path) -> None:
    """Write the sample character into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "hero.glb").write_bytes(sample_character.glb())


def write(path: Path, motion: Motion) -> None:
    """Write a motion as BVH, or a prop that stands still, which has one frame, as OBJ."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if len(motion) == 1:
        path.with_suffix(".obj").write_text(obj_text(motion.positions[0]), encoding="utf-8", newline="\n")
    else:
        write_bvh(path.with_suffix(".bvh"), motion, overwrite=True)


if __name__ == "__main__":
    chosen = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    write_samples(chosen or SAMPLES)
    write_characters(chosen or CHARACTERS)
