"""The data of a player: bodies in motion, rows of its timeline, frames to go to; the page of `distretarget view`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.body import Body
from distretarget.body.build import capsules_of
from distretarget.body.segments import find_segments
from distretarget.errors import DistretargetError
from distretarget.io.contacts_file import entry_to_json
from distretarget.io.input_file import InputFile
from distretarget.io.reading import animations_in, parse_full_target, parse_motion
from distretarget.matching.matching import Matching
from distretarget.measure.contacts import CONTACT_DISTANCE
from distretarget.measure.diff import Diff, diff
from distretarget.measure.metrics import BY_KEY
from distretarget.measure.skin import TOUCHABLE
from distretarget.measure.skin_depths import LIMBS
from distretarget.motion import Motion
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.time_series import spans_of
from distretarget.numerics.vectors import Array
from distretarget.pipeline.found_contacts import MarkedContact
from distretarget.report.actors import BUDGET, Actor, Role, encoded, lowest_skin, thinned, to_y_up
from distretarget.report.page import html_page
from distretarget.skin.capsules import SEGMENTS, Capsules
from distretarget.skin.fit import distances
from distretarget.skin.mesh import SkinnedMesh, no_mesh
from distretarget.target import Target

RowKind = Literal["contact", "support", "skin"]
Point = tuple[int, int]
"""An actor of the page, and one of its joints."""

FAR = CONTACT_DISTANCE / 3  # the error of D up to which a contact is kept well
SHOWN_DEPTH = 0.3  # skin less deep inside than this is not shown [limits]
TOUCHING, RESTING = " touching", " on floor"
CODES = 254  # steps of the error of a row
SPANS = 6  # most spans of a row that its description lists
# The tracks that have a row for each part, with the kind and the name of these rows.
TRACKS: dict[str, tuple[RowKind, str]] = {
    "skin_depth": ("skin", "{} inside"),
    "skin_gap": ("contact", "{}" + TOUCHING),
    "foot_height": ("support", "{}" + RESTING),
    "support_height": ("support", "{}" + RESTING),
}
Jump = Mapping[str, object]
"""A frame to go to, with a kind and a text for the menu."""
JUMPS = 12  # contacts in the menu
STILL = "0.0333333"  # the frame time of a character without a motion [s]
MOST = 24  # actors on a page
SMALL = 60_000  # `BUDGET` for a clip among many


@dataclass(frozen=True, eq=False)
class Row:
    """A row of the timeline: a contact, a support or skin inside, which is active in some frames."""

    name: str  # such as "left hand - right hip"
    kind: RowKind  # decides its mark
    values: Array  # (frames,), the error, or for skin the depth; nan where it is not active
    limit: float  # the value up to which it looks right
    unit: str  # of these values
    points: Sequence[Sequence[Point]]  # for each side of the page, the joints between which its mark is
    spots: NDArray[np.intp] | None = None  # (frames,), the joint at which its mark is instead, if that changes
    marked: Sequence[MarkedContact] = ()  # its contacts that were found, dropped or added

    @property
    def spans(self) -> list[list[int]]:
        """The first frame and the end of each span in which it is active."""
        return list(spans_of(np.isfinite(self.values)).tolist())

    @property
    def data(self) -> dict[str, Any]:
        """The row for the page; codes are 0 in inactive frames, else 1 plus the value in `CODES` steps up to `top`."""
        most = float(np.nanmax(self.values, initial=0.0))
        top = max(3.0 * self.limit, most)
        codes = np.where(np.isfinite(self.values), 1 + np.rint(CODES * self.values / top), 0)
        spans = [f"{first}\u2013{end - 1}" for first, end in self.spans]
        listed = ", ".join([*spans[:SPANS], *["\u2026"] * (len(spans) > SPANS)])
        account = f"frames {listed}" if spans else "not measured"
        return {
            "name": self.name,
            "kind": self.kind,
            "unit": self.unit,
            "limit": self.limit,
            "top": top,
            "account": account + (f"; at most {most:.3g} {self.unit} off" if self.unit else ""),
            "codes": encoded(codes, "<u1"),
            "points": self.points,
            "spots": "" if self.spots is None else encoded(self.spots, "<u2"),
            "marked": [
                {"frames": each.entry.frames, "mark": each.mark, "json": entry_to_json(each.entry)}
                for each in self.marked
            ],
        }


def rows_of(
    diff: Diff, solid: Capsules | None, actors: Sequence[int], prefix: str = "", marked: Sequence[MarkedContact] = ()
) -> list[Row]:
    """Return the rows of a diff, first those of dropped or added contacts. `solid` is the surface of B; `actors` are
    the numbers of the actor of A and of others, on joints of B; `prefix` comes before names.
    """
    contacts = [*_contacts(diff, actors)]
    named = {name for row in contacts for name in row.name.split(" - ")}
    rows = [*contacts, *(row for row in _tracks(diff, solid, actors) if row.name.removesuffix(TOUCHING) not in named)]
    rows = [*_with_marks(diff, rows, marked, actors)]
    rows.sort(key=lambda row: all(each.mark == "found" for each in row.marked))
    return [replace(row, name=prefix + row.name) for row in rows]


def _with_marks(
    diff: Diff, rows: Sequence[Row], marked: Sequence[MarkedContact], actors: Sequence[int]
) -> Iterator[Row]:
    """Rows with their marked contacts; and a row for each two parts with marked contacts that have none."""
    left: dict[frozenset[str], list[MarkedContact]] = {}
    for each in marked:
        left.setdefault(frozenset(each.entry.parts), []).append(each)
    for row in rows:
        own = left.pop(frozenset(row.name.removesuffix(RESTING).split(" - ")), []) if row.kind != "skin" else []
        values = np.array(row.values)
        for each in own:
            if each.mark == "dropped":
                values[_frames(each)] = np.nan
        yield replace(row, values=values, marked=own)
    for own in left.values():
        values, on = np.full(len(diff), np.nan), [each for each in own if each.mark == "added"]
        for each in on:
            values[_frames(each)] = 0.0
        joints = _nearest_joints(diff, own[0].entry.parts, _frames(on[0])) if on else ()
        kind: RowKind = "contact" if len(own[0].entry.parts) > 1 else "support"
        name = " - ".join(own[0].entry.parts) + (RESTING if kind == "support" else "")
        yield Row(name, kind, values, 1.0, "", _points(diff, joints, actors), marked=own)


def _frames(marked: MarkedContact) -> slice:
    """The frames of a marked contact."""
    first, last = marked.entry.frames or (0, -1)
    return slice(int(first), int(last) + 1)


def _nearest_joints(diff: Diff, parts: Sequence[str], frames: slice) -> Sequence[int]:
    """The joints of B nearest to each other in some frames, of regions or joints with these names; none if unknown."""
    regions, keys = diff.matching.regions, diff.b.skeleton.keys
    joints = [
        np.flatnonzero(regions.of_joint == regions.names.index(part)) if part in regions.names else [keys.index(part)]
        for part in parts
        if part in regions.names or part in keys
    ]
    if len(joints) < len(parts):
        return ()
    if len(joints) == 1:
        return (int(joints[0][0]),)
    a, b = (diff.b.positions[frames][:, each] for each in joints)
    near = np.linalg.norm(a[:, :, None] - b[:, None], axis=3).mean(axis=0)
    one, other = np.unravel_index(near.argmin(), near.shape)
    return int(joints[0][one]), int(joints[1][other])


def _points(diff: Diff, joints: Sequence[int], actors: Sequence[int]) -> list[list[Point]]:
    first, *others = actors
    drivers = [int(diff.matching.drivers[joint]) for joint in joints]
    of_a = [(first, driver) for driver in drivers] if min(drivers, default=-1) >= 0 else []
    return [of_a, *([(actor, joint) for joint in joints] for actor in others)]


def _contacts(diff: Diff, actors: Sequence[int]) -> Iterator[Row]:
    """A row for each two regions that touch in A, with the error of the gap of skins if known, else of D."""
    contacts, skin = diff.comparison.contacts, diff.comparison.tracks["skin_gap"]
    for touch in contacts.touches:
        on = contacts.regions == contacts.candidates.names.index(touch.name)
        values, points = np.full(len(diff), np.nan), _points(diff, (touch.u, touch.v), actors)
        limbs = [limb for limb, name in enumerate(skin.parts) if name in touch.name.split(" - ")]
        if limbs and skin.weights.any():
            gaps = np.where(skin.weights > 0, skin.values, 0.0)[:, limbs].max(axis=1)
            off, limit, unit = gaps[contacts.frame[on]], margin_of("skin_gap"), BY_KEY["skin_gap"].symbol
        else:
            off, limit, unit = contacts.error[on], FAR, "D"
        values[contacts.frame[on]] = off
        yield Row(touch.name, "contact", values, limit, unit, points)


def margin_of(key: str) -> float:
    """The value of a metric up to which a result looks right."""
    limit = BY_KEY[key].limit
    assert limit is not None
    return limit.margin


def _tracks(diff: Diff, solid: Capsules | None, actors: Sequence[int]) -> Iterator[Row]:
    """A row for each part in the `TRACKS`: feet, other supports and skin."""
    target, keys = diff.matching.target, diff.b.skeleton.keys
    for key, (kind, text) in TRACKS.items():
        track, limit = diff.comparison.tracks[key], margin_of(key)
        for column, part in enumerate(track.parts):
            values = np.full(len(diff), np.nan)
            if track.values.ndim == 2 and len(track.values):
                on = track.weights[:, column] > 0
                if kind == "skin":
                    on &= track.values[:, column] > SHOWN_DEPTH * limit
                values[: len(on)][on] = track.values[on, column]
            joint = target.joint_of(part)
            if joint is not None and np.isfinite(values).any():
                points = _points(diff, (joint,), actors)
                regions = diff.matching.regions
                name = regions.names[regions.of_joint[joint]] if part in keys else part
                row = Row(text.format(name), kind, values, limit, BY_KEY[key].symbol, points)
                yield replace(row, spots=_spots(diff, solid, part, values)) if kind == "skin" and solid else row


def _spots(diff: Diff, solid: Capsules, limb: str, values: Array) -> NDArray[np.intp]:
    """(frames,), the joint of a limb that is deepest in other parts of the body, in frames with a value; else 0."""
    joints = np.flatnonzero(find_segments(diff.matching.target).of_joint == SEGMENTS.index(limb))
    others = TOUCHABLE[LIMBS.index(limb), solid.segments]
    spots, frames = np.zeros(len(values), np.intp), np.flatnonzero(np.isfinite(values))
    if len(joints) and others.any():
        for block in blocks_of(len(frames)):
            some = diff.b[frames[block]]
            away, _ = distances(some.positions[:, joints], solid.posed(some)[:, others], solid.radii[others])
            spots[frames[block]] = joints[away.argmin(axis=1)]
    return spots


@dataclass(frozen=True, eq=False, kw_only=True)
class ShownBody:
    """A performer or a prop."""

    name: str
    motions: Sequence[Motion]  # on each side of the page, first in A or the source
    matching: Matching | None = None  # of a performer's first motion to the others; None for a prop
    skins: tuple[Capsules | None, Capsules | None] = (None, None)  # its surface on the first side and on the others
    meshes: tuple[SkinnedMesh | None, SkinnedMesh | None] = (None, None)  # the same as meshes

    def actor(self, side: int, role: Role, turn: Rotation, unit: float, floor: float) -> Actor:
        """Return the body as an actor on a side; `role` is that of performers, others as in `Actor`."""
        matching, other = self.matching, min(side, 1)
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


def bodies_in_motion(
    bodies: Sequence[ShownBody], sides: Mapping[str, Role], up: Array, units: tuple[float, float], facing: float
) -> dict[str, object]:
    """Return the data of bodies in one world, on `sides`: titles, with the roles of performers. `units` are those of
    length of the first side and the others; `facing` is the direction seen from in front, from z about y [rad].
    """
    floors = [
        min(lowest_skin(one.motions[-other], one.skins[other], one.meshes[other], up) for one in bodies if one.matching)
        for other in (0, 1)
    ]  # of all performers of a world, in the motion of its last side
    actors = [
        body.actor(side, role, to_y_up(up), units[min(side, 1)], floors[min(side, 1)])
        for side, role in enumerate(sides.values())
        for body in bodies
    ]
    length, time = len(bodies[0].motions[0]), bodies[0].motions[-1].frame_time
    return {"sides": [*sides], "frames": length, "frame_time": time, "facing": facing, **thinned(actors)}


def timeline(rows: Sequence[Row], jumps: Sequence[Jump] = ()) -> dict[str, Any]:
    """Return the data of the timeline; `jumps` are followed by those to the first contacts."""
    starts = sorted((row.spans[0][0], row.name) for row in rows if row.kind == "contact" and row.spans)
    contacts = [{"frame": at, "kind": "Contacts", "text": f"{name} \u00b7 {at}"} for at, name in starts[:JUMPS]]
    return {"rows": [row.data for row in rows], "jumps": [*jumps, *contacts]}


def facing(body: Body, motion: Motion, up: Array) -> float:
    """Return the heading of a body in the first frame, as an angle from z about y [rad]; 0 without legs."""
    if body.legs is None:
        return 0.0
    left, right = (motion.positions[0, leg.hip] for leg in body.legs)
    front = to_y_up(up).apply(np.cross(left - right, up))
    return float(np.arctan2(front[0], front[2]))


def rows_of_body(
    body: ShownBody, diff: Diff, marked: Sequence[MarkedContact] = (), number: int = 0, among: int = 1
) -> list[Row]:
    """Return the rows of a performer, number `number` of `among` bodies on a side of a page; others as in `rows_of`."""
    numbers = range(number, len(body.motions) * among, among)
    return rows_of(diff, body.skins[1], numbers, f"{body.name}: " if among > 1 else "", marked)


def view_page(actors: Sequence[Actor], title: str, first: int = 0) -> str:
    """The HTML of a page with actors, each on its side; the `first` is shown alone if they are many."""
    return html_page("scene", title, {"stage": stage_of(actors, first), "numbers": []})


def stage_of(actors: Sequence[Actor], first: int = 0, budget: int = BUDGET) -> dict[str, object]:
    """The data of the player of `view_page`, with as many frames as the budget allows."""
    frame_time = min(actor.motion.frame_time for actor in actors)
    seconds = max(len(actor.motion) * actor.motion.frame_time for actor in actors)
    rows = _rows(actors[0]) if len(actors) == 1 else []
    names, frames = [actor.name for actor in actors], max(round(seconds / frame_time), 1)
    motions = {"sides": names, "frames": frames, "frame_time": frame_time, "facing": 0.0, "first": first}
    return {**motions, **timeline(rows), **thinned(actors, budget)}


def _rows(actor: Actor) -> list[Row]:
    """The contacts and supports of a motion; none if its body is not recognised."""
    try:
        with np.errstate(all="ignore"):
            rows = rows_of(diff(actor.motion, actor.motion), actor.capsules, [0])
            return [row if row.kind == "skin" else replace(row, unit="") for row in rows if row.points[0]]
    except DistretargetError:
        return []


def actors_of(file: InputFile, side: int = 0, clip: str | None = None) -> list[Actor]:
    """Return the actors of a file, on sides from `side` on: of its motion, animations or `clip`, or at rest."""
    name, motions = Path(file.path).name, [*_motions(file, clip)]
    first = shown_actor(name, side, parse_full_target(file), motions[0][1] if motions else None)
    if len(motions) < 2:
        return [first]
    return [
        replace(first, name=f"{name}: {title}", side=side + k, motion=motion)
        for k, (title, motion) in enumerate(motions)
    ]


def _motions(file: InputFile, clip: str | None) -> Iterator[tuple[str, Motion]]:
    if file.kind == "BVH":
        yield "", parse_motion(file)[0]
    names = animations_in(file)
    if clip is not None and len(names) > 1:
        yield clip, parse_motion(file, clip)[0]
        return
    for number, name in enumerate(names[:MOST], 1):
        yield f"{number} {name}".rstrip(), parse_motion(file, f"#{number}")[0]


def small_stage(source: InputFile, clip: str | None, result: InputFile) -> dict[str, object]:
    """The data of a player of a clip and its result, in few bytes; a DistretargetError if a file cannot be read."""
    roles: tuple[Role, Role] = ("source", "result")
    actors = []
    for side, (file, own) in enumerate(((source, clip), (result, f"#{len(animations_in(result))}"))):
        target = replace(parse_full_target(file), mesh=no_mesh)
        motion = next((motion for _, motion in _motions(file, own)), None)
        actors.append(replace(shown_actor(roles[side].title(), side, target, motion), role=roles[side]))
    return stage_of(actors, budget=SMALL)


def shown_actor(name: str, side: int, target: Target, motion: Motion | None) -> Actor:
    """Return a target as an actor, in a motion or in its rest pose, facing the camera at first."""
    skeleton = target.skeleton if motion is None else motion.skeleton
    if motion is None or not len(motion):
        motion = Motion(skeleton, skeleton.offsets[None, 0], skeleton.rest_rotations[None], STILL)
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
        turn=Rotation.from_euler("y", -facing(body, motion, body.up_vector)) * to_y_up(body.up_vector),
        unit=body.height or body.unit or 1.0,
        floor=lowest_skin(motion, capsules, mesh, body.up_vector),
    )
