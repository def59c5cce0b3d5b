"""Pictures of the zoo: for each member frames of source, copied rotations and result side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from draw import Camera, Cell, write_picture
from rigs import articulated, figure, result_turn
from zoo_runs import clip_name, plan, retargeted

from distretarget import Motion, RetargetResult

CLIPS = 4  # that a picture shows, each in a row
FROM_THE_SIDE = Camera(azimuth=90.0, elevation=2.0)  # the floor is a narrow strip


def draw_sheets(folder: Path, clips: Sequence[Path], members: Sequence[str], frames: int | None) -> None:
    """Draw a picture for each member into a folder, with the clips of its plan that move most."""
    folder.mkdir(parents=True, exist_ok=True)
    runs = list(plan(clips, members))
    for name in members:
        own = [clip for clip, member in runs if member == name]
        chosen = own[:: -(-len(own) // CLIPS)]
        results = {clip_name(clip): retargeted(clip, name, frames) for clip in chosen}
        draw_sheet(folder / f"{name}.png", results)


def draw_sheet(path: Path, results: dict[str, RetargetResult]) -> None:
    """Draw a row for each clip."""
    scenes, titles, labels = [], [], []
    for clip, result in results.items():
        shown = _frames(result)
        scenes.append([cell for frame in shown for cell in _cells(result, frame)])
        titles.append(clip)
        labels.append([f"{label} {frame}" for frame in shown for label in ("source", "copy", "result")])
    write_picture(scenes, titles, labels, path, camera=FROM_THE_SIDE, dpi=60)


def _frames(result: RetargetResult) -> list[int]:
    """Three frames: the first, the middle one, and that in which the source's posture differs most from its mean."""
    return [0, len(result.motion) // 2, articulated(result.source)]


def _cells(result: RetargetResult, frame: int) -> list[Cell]:
    """Source, copy and result in a frame, with legs of equal length, on the source's floor at the scale of each."""
    source, target = result.matching.source, result.matching.target
    floor = source.lowest(result.world.up_vector)
    return [
        _cell(result.source, result, frame, floor, source.unit),
        _cell(result.rotation_copy, result, frame, result.root_scale * floor, target.unit),
        _cell(result.motion, result, frame, result.root_scale * floor, target.unit),
    ]


def _cell(motion: Motion, result: RetargetResult, frame: int, floor: float, unit: float) -> Cell:
    """A figure that faces +Z, with its body above the origin and the floor at height 0 [body units]."""
    turned = figure(motion, result_turn(result, frame))
    points = turned.positions[frame] / unit
    ground = points[0] * (1, 0, 1)
    return Cell(turned.skeleton, points - ground - (0, floor / unit, 0), ground, 1.0)
