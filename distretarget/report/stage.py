"""What a player shows: bodies in motion on its sides, what touches and rests as rows of a timeline, frames to go to.

And the page that shows motions and characters as they are, before anything is retargeted.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.body import Body
from distretarget.body.build import capsules_of
from distretarget.errors import DistretargetError
from distretarget.io.input_file import InputFile
from distretarget.io.motion_file import parse_motion
from distretarget.io.target_file import animations_in, parse_full_target
from distretarget.measure.diff import Diff, diff
from distretarget.motion import Motion
from distretarget.numerics.vectors import Array
from distretarget.pipeline.found_contacts import MarkedContact
from distretarget.report.actors import BUDGET, Actor, Role, lowest_skin, thinned, upright
from distretarget.report.page import html_page
from distretarget.report.timeline_rows import Row, rows_of
from distretarget.skin.capsules import Capsules
from distretarget.skin.mesh import SkinnedMesh, no_mesh
from distretarget.target import Target

Jump = Mapping[str, object]
"""A frame to go to, its kind, and a text that says why."""

JUMPS = 12  # contacts that a menu lists
STILL = "0.0333333"  # the time that a character without a motion is shown [s]
MOST = 24  # actors on a page
SMALL = 60_000  # characters for the rotations of a clip among many


@dataclass(frozen=True, eq=False, kw_only=True)
class ShownBody:
    """A performer or a prop."""

    name: str
    motions: Sequence[Motion]  # on each side of the page, first in A or the source
    measured: Diff | None = None  # a performer's last motion against its first; None for a prop
    skins: tuple[Capsules | None, Capsules | None] = (None, None)  # its surface on the first side and on the others
    meshes: tuple[SkinnedMesh | None, SkinnedMesh | None] = (None, None)  # the same as meshes
    marked: Sequence[MarkedContact] = ()  # a performer's contacts that were found, dropped and added

    def actor(self, side: int, role: Role, turn: Rotation, unit: float, floor: float) -> Actor:
        """Return the body as it moves on a side, where performers have a role; others as in `Actor`."""
        matching, other = self.measured and self.measured.matching, min(side, 1)
        return Actor(
            name=self.name,
            side=side,
            role=role if matching else "prop",
            motion=self.motions[side],
            body=(matching.source, matching.target)[other] if matching else None,
            capsules=self.skins[other],
            mesh=self.meshes[other],
            turn=turn,
            unit=unit,
            floor=floor,
        )


def stage_of_bodies(
    bodies: Sequence[ShownBody],
    sides: Mapping[str, Role],
    up: Array,
    units: tuple[float, float],
    facing: float,
    rows: Sequence[Row] = (),
    jumps: Sequence[Jump] = (),
) -> dict[str, object]:
    """Return what the player shows of bodies in one world, on sides with these titles and roles of performers.

    `units` are the lengths that the first side and the others count in, `facing` is the direction seen from in front,
    an angle from z about y; `rows` and `jumps` come before those of the bodies.
    """
    rows = [*rows]
    for number, body in enumerate(bodies):
        if body.measured:
            numbers = range(number, len(sides) * len(bodies), len(bodies))
            prefix = f"{body.name}: " if len(bodies) > 1 else ""
            rows += rows_of(body.measured, body.skins[1], numbers, prefix, body.marked)
    floors = [
        min(lowest_skin(one.motions[-other], one.skins[other], one.meshes[other], up) for one in bodies if one.measured)
        for other in (0, 1)
    ]  # all that stand in one world have one floor, that of its last side
    actors = [
        body.actor(side, role, upright(up), units[min(side, 1)], floors[min(side, 1)])
        for side, role in enumerate(sides.values())
        for body in bodies
    ]
    length, time = len(bodies[0].motions[0]), bodies[0].motions[-1].frame_time
    return stage_data([*sides], length, time, actors, rows, jumps=jumps, facing=facing)


def stage_data(
    sides: Sequence[str],
    frames: int,
    frame_time: float,
    actors: Sequence[Actor],
    rows: Sequence[Row],
    budget: int = BUDGET,
    jumps: Sequence[Jump] = (),
    **others: float,
) -> dict[str, Any]:
    """Return the values that the player reads, with as many frames as fit in a budget; `others` go with them.

    The beginnings of the first contacts follow the `jumps`.
    """
    starts = sorted((row.spans[0][0], row.name) for row in rows if row.kind == "contact" and row.spans)
    contacts = [{"frame": at, "kind": "Contacts", "text": f"{name} \u00b7 {at}"} for at, name in starts[:JUMPS]]
    return {
        "sides": sides,
        "frames": frames,
        "frame_time": frame_time,
        "rows": [row.data for row in rows],
        "jumps": [*jumps, *contacts],
        **others,
        **thinned(actors, budget),
    }


def facing(body: Body, motion: Motion, up: Array) -> float:
    """Return where a body faces in the first frame, as an angle from z about y [rad]; 0 without legs."""
    if body.legs is None:
        return 0.0
    left, right = (motion.positions[0, leg.hip] for leg in body.legs)
    front = upright(up).apply(np.cross(left - right, up))
    return float(np.arctan2(front[0], front[2]))


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


def actors_of(file: InputFile, side: int = 0, clip: str | None = None) -> list[Actor]:
    """Return what a file shows, on sides from the number `side` on: its motion, each of its animations or that called
    `clip`, or the rest pose where it has none; a DistretargetError if it cannot be read.
    """
    name, motions = Path(file.path).name, [*_motions(file, clip)]
    first = shown_actor(name, side, parse_full_target(file), motions[0][1] if motions else None)
    if len(motions) < 2:
        return [first]
    return [
        replace(first, name=f"{name}: {title}", side=side + k, motion=motion)
        for k, (title, motion) in enumerate(motions)
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
    roles: tuple[Role, Role] = ("source", "result")
    actors = []
    for side, (file, own) in enumerate(((source, clip), (result, f"#{len(animations_in(result))}"))):
        target = replace(parse_full_target(file), mesh=no_mesh)
        motion = next((motion for _, motion in _motions(file, own)), None)
        actors.append(replace(shown_actor(roles[side].title(), side, target, motion), role=roles[side]))
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
