"""Write the sample clips, scenes and target skeletons.

    python tools/make_samples.py [FOLDER]

FOLDER is `sample_bvh` by default. Every run writes the same bytes.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sample_body import SKELETON
from sample_motions import CLIPS
from sample_scenes import SCENES, SampleScene, obj_text
from sample_supports import SUPPORTED

from distretarget import Skeleton, write_bvh
from distretarget.io.target_file import FORMAT, VERSION, skeleton_to_json
from distretarget.scene.scene_file import HEADER as SCENE_HEADER

SAMPLES = Path(__file__).resolve().parents[1] / "sample_bvh"

# Parts of the body, by the names of the lower joints of their bones.
PARTS = {
    "spine": r"Chest\d?|Neck|Head",
    "head": r"Head_End",
    "shoulders": r"(Left|Right)(Collar|Shoulder)",
    "arms": r"(Left|Right)(Elbow|Wrist|Wrist_End)",
    "hips": r"(Left|Right)Hip",
    "legs": r"(Left|Right)(Knee|Ankle|Toe|Toe_End)",
}
# Factors on the lengths of the bones: for each part in full targets, for single bones in edits.
BODIES = {
    "child": {"spine": 0.85, "head": 0.97, "shoulders": 0.72, "arms": 0.7, "hips": 0.75, "legs": 0.6},
    "giant": {
        "spine": 1.9,
        "head": 1.8,
        "shoulders": 1.9 * 1.3,
        "arms": 1.9 * 1.2,
        "hips": 1.9 * 1.1,
        "legs": 1.9,
    },
}
EDITS = {
    "long_arms": dict.fromkeys(["LeftWrist", "LeftWrist_End", "RightWrist", "RightWrist_End"], 1.5),
    "long_spine": dict.fromkeys(["Chest", "Chest2", "Chest3", "Neck"], 1.6),
}


def reshaped(skeleton: Skeleton, factors: Mapping[str, float]) -> Skeleton:
    """The skeleton with the bones of each part of the body scaled by that part's factor."""
    offsets = skeleton.offsets.copy()
    for joint, name in enumerate(skeleton.names[1:], start=1):
        part = next(part for part, pattern in PARTS.items() if re.fullmatch(pattern, name))
        offsets[joint] *= factors[part]
    return skeleton.with_offsets(offsets.round(6))


def write_scene(folder: Path, scene: SampleScene) -> None:
    """Write a scene into a folder: clips, props, and `scene.json`, with the child as the target of all."""
    folder.mkdir(parents=True, exist_ok=True)
    names = list(scene.performers)
    for name, motion in scene.performers.items():
        write_bvh(folder / f"{name}.bvh", motion, overwrite=True)
    props = []
    for prop in scene.props:
        file = f"{prop.name}.{'obj' if len(prop.motion) == 1 else 'bvh'}"
        if file.endswith("obj"):
            write_text(folder / file, obj_text(prop.motion.positions[0]))
        else:
            write_bvh(folder / file, prop.motion, overwrite=True)
        held_by = [{"performer": names[grip.performer], "joint": grip.joint} for grip in prop.held_by]
        props.append({"name": prop.name, "file": file} | ({"held_by": held_by} if held_by else {}))
    performers = [{"source": f"{name}.bvh", "target": "../../child.json"} for name in names]
    document = {**SCENE_HEADER, "performers": performers}
    write_json(folder / "scene.json", document | ({"props": props} if props else {}))


def write_samples(folder: Path) -> None:
    """Write all clips and targets into a folder, the clips with known supports into its folder `supports`, the
    scenes into `scenes`; replace files of the same names.
    """
    (folder / "supports").mkdir(parents=True, exist_ok=True)
    for name, clip in CLIPS.items():
        write_bvh(folder / f"{name}.bvh", clip(), overwrite=True)
    for name, sample in SUPPORTED.items():
        write_bvh(folder / "supports" / f"{name}.bvh", sample().motion, overwrite=True)
    for name, scene in SCENES.items():
        write_scene(folder / "scenes" / name, scene())
    for name, factors in BODIES.items():
        write_text(folder / f"{name}.json", skeleton_to_json(reshaped(SKELETON, factors), name))
    for name, factors in EDITS.items():
        document = {"format": FORMAT, "version": VERSION, "name": name, "factors": factors}
        write_json(folder / f"{name}.json", document)


def write_json(path: Path, document: dict[str, Any]) -> None:
    write_text(path, json.dumps(document, indent=2) + "\n")


def write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    write_samples(Path(sys.argv[1]) if len(sys.argv) > 1 else SAMPLES)
