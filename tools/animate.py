"""Draw motions as stick figures side by side, in a moving picture that repeats.

    python tools/animate.py walk.bvh child_walk.bvh --frames 0:120 -o walk.gif --same-scale

A body that walks stays in the middle, and the floor passes below it. Needs matplotlib (the extra `docs`).
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from draw import INCHES_PER_HEIGHT, VIEWS, Camera, Cell, Stage, body_height, cells
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from distretarget import Motion, read_bvh

RATE = 20  # of the picture [frames/s]
COLOURS = 32  # of all frames together; fewer make a smaller file
DPI = 96


@dataclass(frozen=True)
class Loop:
    """Scenes that follow each other in one place, for a moving picture or a still.

    Attributes:
        stage: what every scene shows.
        scenes: the figures from left to right, at each time.
        labels: from left to right, equally many figures for each.
        duration: of each scene [ms].
    """

    stage: Stage
    scenes: Sequence[Sequence[Cell]]
    labels: Sequence[str]
    duration: float

    @classmethod
    def of_motions(
        cls,
        rows: Sequence[tuple[str, Motion]],
        frames: tuple[int, int],
        *,
        view: str = "three-quarter",
        same_scale: bool = False,
    ) -> Loop:
        """Motions side by side.

        Args:
            rows: a label and a motion, all with the same frame time.
            frames: the first, and the one after the last.
            view: "front", "side" or "three-quarter", for a body that faces +Z with Y up.
            same_scale: keep the relative sizes of the bodies; otherwise all are drawn equally tall.
        """
        frame_time = rows[0][1].frame_time
        step = max(1, round(1 / RATE / frame_time))
        size = max(body_height(motion.skeleton) for _, motion in rows) if same_scale else None
        columns = [cells(motion, range(*frames, step), None, size) for _, motion in rows]
        return cls.of_columns([label for label, _ in rows], columns, 1000 * step * frame_time, view)

    @classmethod
    def of_columns(
        cls, labels: Sequence[str], columns: Sequence[Sequence[Cell]], duration: float, view: str = "three-quarter"
    ) -> Loop:
        """Figures that change in place, from left to right: of each, a cell for every scene."""
        scenes = list(zip(*columns, strict=True))
        stage = Stage.around([cell for column in columns for cell in column], Camera(*VIEWS[view]))
        return cls(stage, scenes, labels, duration)

    def write_gif(self, path: Path, dpi: int = DPI) -> None:
        """Write a GIF that repeats for ever; `dpi` is pixels per inch, where a body is 2.3 inches tall."""
        images = [self._drawn(scene, dpi) for scene in self.scenes]
        palette = images[0].quantize(COLOURS, dither=Image.Dither.NONE)
        first, *others = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images)
        first.save(path, save_all=True, append_images=others, duration=round(self.duration), loop=0, optimize=True)

    def write_still(self, path: Path, number: int, dpi: int = DPI) -> None:
        """Write one of the scenes as a picture of the same size."""
        self._drawn(self.scenes[number], dpi).quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)

    def _drawn(self, scene: Sequence[Cell], dpi: int) -> Image.Image:
        stage = self.stage
        size = (stage.pitch * len(self.labels) * INCHES_PER_HEIGHT, (stage.high - stage.low) * INCHES_PER_HEIGHT)
        figure = Figure(size, dpi=dpi, facecolor="white")
        canvas = FigureCanvasAgg(figure)
        stage.draw(figure.add_axes((0, 0, 1, 1)), scene, self.labels)
        canvas.draw()
        return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def main() -> None:
    """Draw the files named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", type=Path, metavar="A.bvh")
    parser.add_argument("--frames", required=True, help="the first frame and the one after the last, as 0:120")
    parser.add_argument("-o", "--output", required=True, type=Path, metavar="OUT.gif")
    parser.add_argument("--view", choices=VIEWS, default="three-quarter")
    parser.add_argument("--same-scale", action="store_true", help="keep the relative sizes of the bodies")
    args = parser.parse_args()
    first, end = (int(number) for number in args.frames.split(":"))
    rows = [(file.stem, read_bvh(file)) for file in args.files]
    Loop.of_motions(rows, (first, end), view=args.view, same_scale=args.same_scale).write_gif(args.output)


if __name__ == "__main__":
    main()
