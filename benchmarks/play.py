"""Let other programs play files of characters, and show how far off they have the joints [mm].

    DISTRETARGET_NODE=PACKAGES DISTRETARGET_BLENDER=PYTHON python benchmarks/play.py FOLDER [--pictures FOLDER]
    ... python benchmarks/play.py CHARACTERS --clip CLIP.bvh ... --written FOLDER [--pictures FOLDER]

FOLDER holds files, GLB, glTF, VRM and VRMA, each with an npz beside it that says what should be seen: `NAME.glb` and
`NAME.npz` with `nodes` (nodes,), `times` (frames,) [s] and `positions` (frames, nodes, 3) [m], and if need be
`animation`, its name or number (the last one), `input`, the file whose faults do not count, and for VRMA `vrm`, the
file of the character that it moves. A path is taken from FOLDER. With `--clip`, such files are made first: each clip
retargeted to each character in CHARACTERS, VRM models as VRM and as VRMA; they go into the folder `--written`.

The programs are those of tests/interop/players.py; PACKAGES is where `npm install three @babylonjs/core
@babylonjs/loaders @pixiv/three-vrm @pixiv/three-vrm-animation esbuild gltf-validator` was run, PYTHON that of an
environment with the package bpy.
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

from distretarget import load_target, read_bvh, retarget, write_motion

ENDINGS = (".glb", ".gltf", ".vrm", ".vrma")
FRAMES = 120  # of each clip that is made


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


def make(characters: Path, clips: tuple[Path, ...], folder: Path) -> None:
    """Write each clip, or its beginning, on each character, and what should be seen."""
    folder.mkdir(parents=True, exist_ok=True)
    for hero in sorted(path.resolve() for path in characters.iterdir() if path.suffix in ENDINGS[:3]):
        target = load_target(hero)
        for clip in clips:
            motion = retarget(read_bvh(clip)[:FRAMES], target).motion
            nodes = target.character.nodes[-len(motion.skeleton) :]
            times = motion.frame_time * np.arange(len(motion))
            seen = {"nodes": nodes, "times": times, "positions": motion.positions}
            path = folder / f"{hero.stem}_{clip.stem}{hero.suffix}"
            write_motion(path, motion, hero, overwrite=True)
            np.savez(path.with_suffix(".npz"), input=str(hero), **seen)
            if hero.suffix == ".vrm":
                path = folder / f"{hero.stem}_{clip.stem}_humanoid.vrma"
                write_motion(path, motion, hero, overwrite=True)
                bones = [joint for _, joint in motion.skeleton.humanoid]
                seen |= {"nodes": nodes[bones], "positions": motion.positions[:, bones]}
                np.savez(path.with_suffix(".npz"), vrm=str(hero), **seen)


@click.command(help=__doc__)
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--clip", "clips", multiple=True, type=click.Path(exists=True, path_type=Path), help="A BVH file.")
@click.option("--written", type=click.Path(path_type=Path), help="Where files go that are made.")
@click.option(
    "--pictures", type=click.Path(path_type=Path), help="A folder for a picture by each program of each file."
)
def main(folder: Path, clips: tuple[Path, ...], written: Path | None, pictures: Path | None) -> None:
    """Print the table."""
    if clips:
        if written is None:
            raise click.UsageError("--clip needs --written")
        make(folder, clips, written)
    if pictures:
        pictures.mkdir(parents=True, exist_ok=True)
    with Players() as players:
        rows = [list(cells(players, *each, pictures)) for each in expected_in(written or folder)]
    print(table(["file", *PLAYERS, "new errors"], rows))


if __name__ == "__main__":
    main()
