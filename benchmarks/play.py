"""Let other programs play files of characters, and show how far off they have the joints [mm].

    DISTRETARGET_NODE=PACKAGES DISTRETARGET_BLENDER=PYTHON python benchmarks/play.py FOLDER [--pictures FOLDER]

FOLDER holds files, GLB, glTF, VRM and VRMA, each with an npz beside it that says what should be seen: `NAME.glb` and
`NAME.npz` with `nodes` (nodes,), `times` (frames,) [s] and `positions` (frames, nodes, 3) [m], and if need be
`animation`, its name or number (the last one), `input`, the file whose faults do not count, and for VRMA `vrm`, the
file of the character that it moves. A path is taken from FOLDER. The programs are those of tests/interop/players.py;
PACKAGES is where `npm install three @babylonjs/core @babylonjs/loaders @pixiv/three-vrm @pixiv/three-vrm-animation
esbuild gltf-validator` was run, PYTHON that of an environment with the package bpy.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np

sys.path += [str(Path(__file__).resolve().parents[1] / folder) for folder in ("tests", "tools")]
from gltf_player import load
from interop.played import Expected
from interop.players import PLAYERS, Players, missing, problems
from tables import table

ENDINGS = (".glb", ".gltf", ".vrm", ".vrma")


def expected_in(folder: Path) -> Iterator[tuple[Expected, Path | None]]:
    """What should be seen of the files in a folder, and the file that each was made from."""
    for path in sorted(path for path in folder.iterdir() if path.suffix in ENDINGS):
        npz = path.with_suffix(".npz")
        if not npz.is_file():
            continue
        with np.load(npz) as arrays:
            if "times" not in arrays:
                continue
            extra = {name: arrays[name].item() for name in ("animation", "input", "vrm") if name in arrays}
        if (path.suffix == ".vrma") != ("vrm" in extra):  # the npz is that of the character beside it
            continue
        animation = extra.get("animation", len(load(path)[0]["animations"]) - 1)
        character, vrma = (folder / extra["vrm"], path) if "vrm" in extra else (path, None)
        yield Expected.load(character, animation, npz, vrma), folder / extra["input"] if "input" in extra else None


def cells(players: Players, expected: Expected, made_from: Path | None, pictures: Path | None) -> Iterator[str]:
    """A row of the table: the file, how far off each program is, and errors of the validator."""
    path = expected.vrma or expected.path
    yield path.name
    vrm = bool(expected.vrma) or {"VRM", "VRMC_vrm"} & set(load(expected.path)[0].get("extensions", {}))
    for program in PLAYERS:
        if (program == "three-vrm" and not vrm) or (program != "three-vrm" and expected.vrma):
            yield ""
        elif missing(program):
            yield "-"
        else:
            picture = pictures / f"{path.name}_{program}.png" if pictures else None
            try:
                yield f"{1000 * expected.farthest(players, program, picture):.4f}"
            except Exception as error:  # of the program: the table shows it
                print(f"{path.name}, {program}: {error}", file=sys.stderr)
                yield "fails"
    if missing("validator"):
        yield "-"
    else:
        new = problems(path) - (problems(made_from) if made_from else set())
        yield json.dumps(sorted(new)) if new else "0"


@click.command(help=__doc__)
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option(
    "--pictures", type=click.Path(path_type=Path), help="A folder for a picture by each program of each file."
)
def main(folder: Path, pictures: Path | None) -> None:
    """Print the table."""
    if pictures:
        pictures.mkdir(parents=True, exist_ok=True)
    with Players() as players:
        rows = [list(cells(players, *each, pictures)) for each in expected_in(folder)]
    print(table(["file", *PLAYERS, "new errors"], rows))


if __name__ == "__main__":
    main()
