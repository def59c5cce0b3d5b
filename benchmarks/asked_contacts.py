"""Measure what contact files ask for, on clips and bodies: made contacts, drops, and what was found given back.

    python benchmarks/asked_contacts.py CORPUS TARGET... [--only GLOB]

For each clip and body: how far made contacts are off what is asked [% of height], between skins where the body has a
skin; how far hands and forearms are inside the body at most, beyond that of the result without the contact [% of
height]; the jerk over that without; frames that change farther away than two blends; how far the clip with all
contacts dropped is off the clip solved without contacts [body units]; and whether found contacts, given back, change
nothing.
"""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import click
import numpy as np
from clips import corpus_argument, found
from numpy.typing import NDArray

from distretarget import (
    Contact,
    ContactList,
    ContactSettings,
    DistretargetError,
    Motion,
    RetargetResult,
    find_contacts,
    load_target,
    read_motion,
    retarget,
)
from distretarget.io.contacts_file import contacts_to_json, parse_contacts
from distretarget.objectives.constraints import centimetres
from distretarget.skin.balls import segment_gaps
from distretarget.target import LoadedTarget

CLIPS = (
    *(f"{name}.bvh" for name in ("clap", "hands_on_hips", "squat", "turn", "walk", "wave")),
    *(f"animated_drawings/{name}.bvh" for name in ("dab", "wave_hello", "zombie")),
    *(f"cmu_mb/{name}.bvh" for name in ("02_01", "05_03")),
    *(f"cmu_daz/{name}.bvh" for name in ("13_11", "14_04")),
    "makehuman/dance1.bvh",
)
LONGEST = 5.0  # of each clip, from its start [s]
MADE = (("right hand", 0.0), ("right hand", 5.0), ("head", 0.0), ("hips", 3.0), ("right forearm", 0.0))
BLENDS = 0.72  # twice the time `blend` [s]
HEAD = "clip", "body", "contact", "off %", "inside %", "jerk", "changed far away", "unmet"


class Made(NamedTuple):
    """A contact that was made, as measured."""

    off: float  # off the gap that is asked, at most [% of height]
    inside: float  # hands and forearms in the body, beyond that without it, at most [% of height]
    jerk: float  # over that without it
    far_away: int  # frames that change farther away than two blends
    unmet: bool  # whether the verdict says that it is met in part


def gaps_between(result: RetargetResult, one: str, other: str) -> NDArray[np.float64]:
    """(frames,), the gap between two parts: that between skins, else between their nearest joints [heights]."""
    regions, height = result.matching.regions, result.matching.target.height
    parts = [np.flatnonzero(regions.of_joint == regions.names.index(name)) for name in (one, other)]
    if result.skins and len(on := result.skins.target.between(*parts)):
        skin = result.skins.target
        gaps = segment_gaps(skin.balls, skin.posed(result.motion), 4.0)[:, on].min(axis=1)
        return np.asarray(gaps * skin.unit / height)
    if other == "head":  # without the neck, where a region has it
        head = (result.matching.target.anatomy.roles if result.matching.target.anatomy else {}).get("head")
        parts[1] = parts[1] if head is None else np.intersect1d(parts[1], result.motion.skeleton.subtree(head))
    x = result.motion.positions
    a, b = (x[:, joints] for joints in parts)
    return np.asarray(np.linalg.norm(a[:, :, None] - b[:, None], axis=-1).min(axis=(1, 2)) / height)


def jerk(motion: Motion) -> float:
    """The mean jerk of all joints."""
    return float(np.linalg.norm(np.diff(motion.positions, 3, axis=0), axis=-1).mean())


def inside(result: RetargetResult) -> float:
    """How deep hands and forearms are in the body at most [% of height]."""
    return float(result.metrics["result"]["skin_depth"] or 0.0)


def measured(without: RetargetResult, made: RetargetResult, entry: Contact) -> Made:
    """What came of a contact that is made."""
    body, motion = made.matching.target, made.motion
    assert entry.frames is not None
    first, last = map(int, entry.frames)
    wanted = float(entry.gap or 0.0) / centimetres(body.unit) / body.height
    off = np.abs(gaps_between(made, *entry.between)[first : last + 1] - wanted).max()
    same = (motion.rotations == without.motion.rotations).all(axis=(1, 2))
    same &= (motion.root_positions == without.motion.root_positions).all(axis=1)
    reach, frames = BLENDS / motion.frame_time, np.arange(len(motion))
    far_away = ~same & ((frames < first - reach) | (frames > last + reach))
    return Made(
        100.0 * float(off),
        inside(made) - inside(without),
        jerk(motion) / max(jerk(without.motion), 1e-12),
        int(far_away.sum()),
        bool(made.unmet),
    )


def all_dropped_off(source: Motion, target: LoadedTarget, result: RetargetResult) -> float:
    """How far a clip with all contacts dropped is off the clip that is solved without contacts [body units]."""
    regions = result.matching.regions
    there = [name for number, name in enumerate(regions.names) if (regions.of_joint == number).any()]
    drops = []
    for pair in combinations(there, 2):
        if not regions.neighbours[regions.names.index(pair[0]), regions.names.index(pair[1])]:
            drops.append(Contact(between=pair, keep=False))
    dropped = retarget(source, target, contacts=ContactList(tuple(drops)))
    none = retarget(source, target, settings=ContactSettings(strength=0.0))
    return float(np.abs(dropped.motion.positions - none.motion.positions).max() / result.matching.target.unit)


def given_back(source: Motion, target: LoadedTarget, result: RetargetResult) -> bool:
    """Whether what was found, written to a file and read, changes nothing."""
    listed: ContactList = find_contacts(source, target.for_source(source.rigid_skeleton))
    again = retarget(source, target, contacts=parse_contacts(contacts_to_json(listed), "found.json")).motion
    same = np.array_equal(again.rotations, result.motion.rotations)
    return same and np.array_equal(again.root_positions, result.motion.root_positions)


@click.command(help=__doc__)
@corpus_argument
@click.argument("targets", nargs=-1, required=True, type=Path)
@click.option("--only", default="*", help="Only clips whose names match.")
@click.option("--made-only", is_flag=True, help="Leave out drops and what was found.")
def main(corpus: Path, targets: tuple[Path, ...], only: str, made_only: bool) -> None:
    """Print a row for each contact that is made, and one for drops and what was found."""
    print(" | ".join(HEAD))
    for clip, path in found(CLIPS, corpus, only).items():
        whole = read_motion(path)
        source = whole[: round(LONGEST / whole.frame_time)]
        frames = len(source) * 2 // 5, len(source) * 3 // 5
        for file in targets:
            target, began = load_target(file), perf_counter()
            try:
                without = retarget(source, target)
            except DistretargetError as error:
                print(clip, file.stem, error, sep=" | ")
                continue
            for other, gap in MADE:
                entry = Contact(between=("left hand", other), gap=gap, frames=frames)
                try:
                    made = measured(without, retarget(source, target, contacts=ContactList((entry,))), entry)
                except DistretargetError as error:
                    print(clip, file.stem, error, sep=" | ")
                    continue
                values = f"{made.off:.2f}", f"{made.inside:+.2f}", f"{made.jerk:.2f}", made.far_away, made.unmet
                print(clip, file.stem, f"{other} {gap:g}", *values, sep=" | ", flush=True)
            if not made_only:
                drop = all_dropped_off(source, target, without)
                same = given_back(source, target, without)
                print(clip, file.stem, f"drop {drop:.1e}", f"found same: {same}", sep=" | ")
            print(f"  {perf_counter() - began:.0f} s", flush=True)


if __name__ == "__main__":
    main()
