"""A page that shows motions and characters as they are, before anything is retargeted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.body import Body
from distretarget.body.build import capsules_of
from distretarget.errors import DistretargetError
from distretarget.io.input_file import InputFile
from distretarget.io.motion_file import parse_motion
from distretarget.io.target_file import animations_in, parse_full_target
from distretarget.measure.diff import diff
from distretarget.motion import Motion
from distretarget.report.actors import BUDGET, Actor, lowest_skin, upright
from distretarget.report.clip_page import facing
from distretarget.report.page import html_page
from distretarget.report.stage import stage_data
from distretarget.report.timeline_rows import Row, rows_of
from distretarget.skin.mesh import no_mesh
from distretarget.target import Target

STILL = "0.0333333"  # the time that a character without a motion is shown [s]
MOST = 24  # actors on a page
SMALL = 60_000  # characters for the rotations of a clip among many


def actors_of(file: InputFile, side: int = 0, clip: str | None = None) -> list[Actor]:
    """Return what a file shows, on sides from the number `side` on: its motion, each of its animations or that called
    `clip`, or the rest pose where it has none; a DistretargetError if it cannot be read.
    """
    name, motions = Path(file.path).name, dict(_motions(file, clip))
    target = parse_full_target(file)
    first = shown_actor(name, side, target, next(iter(motions.values()), None))
    if len(motions) < 2:
        return [first]
    return [
        replace(first, name=f"{name}: {title}", side=side + k, motion=motion)
        for k, (title, motion) in enumerate(motions.items())
    ]


def _motions(file: InputFile, clip: str | None) -> Iterator[tuple[str, Motion]]:
    """The motions in a file with their names."""
    if file.kind == "BVH":
        yield "", parse_motion(file)[0]
    names = animations_in(file)
    if clip is not None and len(names) > 1:
        yield clip, parse_motion(file, clip)[0]
        return
    for number, name in enumerate(names[:MOST], 1):
        yield f"{number} {name}".rstrip(), parse_motion(file, f"#{number}")[0]


def small_stage(source: InputFile, clip: str | None, result: InputFile) -> dict[str, object]:
    """What plays a clip and its result, side by side, in few bytes; a DistretargetError if a file cannot be read."""
    added = len(animations_in(result))
    actors = []
    for side, (file, own) in enumerate(((source, clip), (result, f"#{added}"))):
        target = parse_full_target(file)
        motion = next(iter(dict(_motions(file, own)).values()), None)
        actor = shown_actor(("Source", "Result")[side], side, replace(target, mesh=no_mesh), motion)
        actors.append(replace(actor, role="result" if side else "source"))
    return stage_of(actors, budget=SMALL)


def shown_actor(name: str, side: int, target: Target, motion: Motion | None) -> Actor:
    """Return the actor for a target as its motion shows it, or in its rest pose, looking to the camera at first."""
    skeleton = target.skeleton if motion is None else motion.skeleton
    if motion is None or not len(motion):
        motion = Motion(skeleton, skeleton.offsets[None, 0], skeleton.unturned[None], STILL)
    body = Body.of_motion(motion)
    mesh = target.mesh()
    capsules = None if mesh else capsules_of(body, None, target.radii)
    return Actor(
        name=name,
        side=side,
        role="result",
        motion=motion,
        body=body,
        capsules=capsules,
        mesh=mesh,
        turn=Rotation.from_euler("y", -facing(body, motion, body.up_vector)) * upright(body.up_vector),
        unit=body.height or body.unit or 1.0,
        floor=lowest_skin(motion, capsules, mesh, body.up_vector),
    )


def view_page(actors: Sequence[Actor], title: str, first: int = 0) -> str:
    """The HTML of a page that shows actors, each on a side of its own, the `first` alone if they are many; one has a
    timeline.
    """
    return html_page("scene", title, {"stage": stage_of(actors, first), "numbers": []})


def stage_of(actors: Sequence[Actor], first: int = 0, budget: int = BUDGET) -> dict[str, object]:
    """What `view_page` shows, as values for the player, with as many frames as fit in a budget."""
    frame_time = min(actor.motion.frame_time for actor in actors)
    seconds = max(len(actor.motion) * actor.motion.frame_time for actor in actors)
    rows = _rows(actors[0]) if len(actors) == 1 else []
    names, frames = [actor.name for actor in actors], max(round(seconds / frame_time), 1)
    return stage_data(names, frames, frame_time, actors, rows, budget, facing=0.0, first=first)


def _rows(actor: Actor) -> list[Row]:
    """What touches and rests in a motion; none where its body is not recognised."""
    try:
        with np.errstate(all="ignore"):
            rows = rows_of(diff(actor.motion, actor.motion), actor.capsules, [0])
            return [row if row.kind == "skin" else replace(row, unit="") for row in rows if row.points[0]]
    except DistretargetError:
        return []
