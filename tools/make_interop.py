"""Write the tables of docs/interop.md: the errors of joint positions when other programs read files.

    DISTRETARGET_NODE=FOLDER DISTRETARGET_BLENDER=PYTHON python tools/make_interop.py

FOLDER is outside of the project; there run

    npm install three assimpjs @babylonjs/core @babylonjs/loaders
    npm install @pixiv/three-vrm @pixiv/three-vrm-animation esbuild gltf-validator

PYTHON is that of an environment with the package bpy. For a missing program the table has the reason. With the same
variables, `pytest tests/interop` runs all programs.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))
from interop.judged import CASES, farthest, written
from interop.played import WRITTEN, plays
from interop.players import PLAYERS, Players, missing
from interop.readers import READERS, Reader
from tables import publish, table

PAGE = Path(__file__).resolve().parents[1] / "docs" / "interop.md"


def cells(reader: Reader) -> Iterator[str]:
    """The cells of a reader: its largest error in each file, or why it is missing."""
    yield reader.name
    for case in CASES:
        if reason := reader.missing():
            yield reason
        else:
            with tempfile.TemporaryDirectory() as folder:
                yield f"{farthest(reader, *written(case, Path(folder))):.0e}"


def played(program: str, players: Players) -> Iterator[str]:
    """The cells of a player of characters: its largest error in each file [mm], or why it is missing."""
    yield program
    for case, make in WRITTEN.items():
        if not plays(program, case):
            yield ""
        elif reason := missing(program):
            yield reason
        else:
            with tempfile.TemporaryDirectory() as folder:
                yield f"{1000 * make(Path(folder)).farthest(players, program):.0e}"


if __name__ == "__main__":
    with Players() as players:
        characters = table(["", *WRITTEN], [list(played(program, players)) for program in PLAYERS])
    publish({"interop": table(["", *CASES], map(cells, READERS)), "players": characters}, PAGE)
