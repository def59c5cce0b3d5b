"""What a player shows: bodies in motion on its sides, what touches and rests as rows of a timeline, frames to go to."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from distretarget.measure.diff import Diff
from distretarget.motion import Motion
from distretarget.pipeline.found_contacts import MarkedContact
from distretarget.report.actors import BUDGET, Actor, Role, lowest_skin, thinned, upright
from distretarget.report.timeline_rows import Row, rows_of
from distretarget.skin.capsules import Capsules
from distretarget.skin.mesh import SkinnedMesh

Array = NDArray[np.float64]
Jump = Mapping[str, object]
"""A frame to go to, its kind, and a text that says why."""

JUMPS = 12  # contacts that a menu lists


@dataclass(frozen=True, eq=False, kw_only=True)
class ShownBody:
    """A performer or a prop.

    Attributes:
        name: its name.
        motions: on each side of the page, first in A or the source.
        measured: a performer's last motion against its first; None for a prop.
        skins, meshes: its surface on the first side and on the others.
        marked: a performer's contacts that were found, dropped and added.
    """

    name: str
    motions: Sequence[Motion]
    measured: Diff | None = None
    skins: tuple[Capsules | None, Capsules | None] = (None, None)
    meshes: tuple[SkinnedMesh | None, SkinnedMesh | None] = (None, None)
    marked: Sequence[MarkedContact] = ()


def stage_of_bodies(
    bodies: Sequence[ShownBody],
    sides: Mapping[str, Role | None],
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
    length, time = len(bodies[0].motions[0]), bodies[0].motions[-1].frame_time
    actors = [*_actors(bodies, [*sides.values()], up, units)]
    return stage_data([*sides], length, time, actors, rows, jumps=jumps, facing=facing)


def _actors(
    bodies: Sequence[ShownBody], roles: Sequence[Role | None], up: Array, units: tuple[float, float]
) -> Iterator[Actor]:
    """The performers and props on all sides; all that stand in one world have one floor, that of its last side."""
    lowest = [
        min(lowest_skin(one.motions[-other], one.skins[other], one.meshes[other], up) for one in bodies if one.measured)
        for other in (0, 1)
    ]
    for side, role in enumerate(roles):
        other = min(side, 1)
        for body in bodies:
            matching = body.measured.matching if body.measured else None
            yield Actor(
                name=body.name,
                side=side,
                role=(role or "other") if matching else "prop",
                motion=body.motions[side],
                body=(matching.source, matching.target)[other] if matching else None,
                capsules=body.skins[other],
                mesh=body.meshes[other],
                turn=upright(up),
                unit=units[other],
                floor=lowest[other],
            )


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
    """Return the values that the player reads, with as many frames as fit in a budget; `others` go with them."""
    return {
        "sides": sides,
        "frames": frames,
        "frame_time": frame_time,
        "rows": [row.data for row in rows],
        "jumps": [*jumps, *_contact_jumps(rows)],
        **others,
        **thinned(actors, budget),
    }


def _contact_jumps(rows: Sequence[Row]) -> Iterator[Jump]:
    """The beginnings of the first contacts of a timeline, for a menu."""
    starts = sorted((row.spans[0][0], row.name) for row in rows if row.kind == "contact" and row.spans)
    for frame, name in starts[:JUMPS]:
        yield {"frame": frame, "kind": "Contacts", "text": f"{name} \u00b7 {frame}"}
