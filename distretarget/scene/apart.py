"""Performers whose bodies would be in each other move apart, slowly, before they are solved.

Balls along the capsules of trunk and head show how far two performers have to part in each frame: along the floor, or
upwards where one sits or lies on the other in the source. Some overlap is allowed: the depth by which flesh gives way,
and for performers side by side as much as the source's bodies overlap. They part and come back slowly, mostly while
somebody steps, and each resting foot stays where it is: its place moves by the mean over its rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np

from distretarget.body.anatomy import TRUNK_REGIONS
from distretarget.motion import Motion
from distretarget.numerics.moving import averaged
from distretarget.numerics.time_series import by_shot, over_runs, smoothstep, widened
from distretarget.numerics.vectors import Array, Flags, Numbers, lengths, level, normalised
from distretarget.objectives.body_skin import BodySkin, Skins
from distretarget.objectives.supports import Supports
from distretarget.scene.contacts import SceneContacts, common_shots, copy_on_path, moved_by
from distretarget.skin.balls import write_ways
from distretarget.skin.capsules import SEGMENTS

BALLS = 5  # along each capsule
FLESH = 0.02  # bodies give way, and capsules stand off from the skin, by this together [body units]
TOUCH = 0.04  # bodies that are nearer than this in the source show whether one is on the other [body units]
SPEED = 0.1  # two performers part at most this fast ... [body units/s]
STANDING = 0.2  # ... times this while both stand on both feet
SOFT = 0.25  # and take twice this time to get as fast [s]
BESIDE = 0.1  # performers whose middles are nearer than this along the floor have no direction to part in [body units]
ROUNDS = 3  # in each, all pairs of performers part

IS_CORE = np.array([" " not in name for name in SEGMENTS])
IS_THIGH = np.array(["thigh" in name for name in SEGMENTS])
IS_SEAT = IS_CORE | IS_THIGH


@dataclass(frozen=True, eq=False)
class Core:
    """The parts of a body that only the whole body can move, as balls."""

    centres: Array  # (frames, balls, 3) [mean body units of the performers]
    radii: Array  # (balls,)

    @classmethod
    def of(cls, skin: BodySkin, motion: Motion, unit: float, parts: Flags) -> Core:
        """Return the balls of some parts, (segments,), of a body in a motion; `unit` is that of lengths."""
        whole = skin.capsules
        on = parts[whole.segments]
        ends = whole[on].posed(motion) / unit
        t = np.linspace(0.0, 1.0, BALLS)
        shares = np.stack([1.0 - t, t])
        centres = np.einsum("fcei,eb->fcbi", ends, shares).reshape(len(ends), -1, 3)
        return cls(centres, (whole.radii[on] @ shares).ravel() / unit)

    def way_from(self, other: Core, along: Array, give: float, ahead: float = 0.5) -> Array:
        """(frames,), how far this body has to move along unit vectors, (frames, 3), until it overlaps the other by no
        more than `give`; only balls count that are apart in a direction whose cosine to these is above `ahead`.
        """
        ways = np.zeros(len(along))
        bodies = self.centres, self.radii, other.centres, other.radii
        centres, radii, others, other_radii, along = map(np.ascontiguousarray, (*bodies, along))
        write_ways(centres, radii, others, other_radii, along, give, ahead, ways)
        return ways


def kept_apart(contacts: SceneContacts, skins: Sequence[Skins | None]) -> SceneContacts:
    """Return the scene with performers apart whose skins would be in each other; `skins` have None for no thickness."""
    known = [number for number, skin in enumerate(skins) if skin]
    ways = [way for both in combinations(known, 2) for way in _ways_between(contacts, skins, both)]
    moves = np.zeros((len(skins), len(contacts.performers[0].clip), 3))
    for _ in range(ROUNDS):
        for way in ways:
            way.add_to(moves)
    moved = [moved_by(*each) for each in zip(contacts.performers, moves, strict=True)]
    return replace(contacts, performers=tuple(moved)) if moves.any() else contacts


@dataclass(frozen=True, eq=False)
class _Way:
    """How two performers part in a direction."""

    numbers: tuple[int, int]
    cores: Sequence[Core]  # of both while nobody is moved
    unit: float  # that of the cores [target file units]
    along: Array  # (frames, 3), the unit vectors along which the first moves, the second against them; or 0
    allowed: Array  # (frames,), the way for which they may stay in each other
    shares: Array  # (frames, 2), of each in the way
    speed: Array  # (frames,), how fast they may part [per frame]
    shots: Numbers  # (frames,)
    soft: float  # frames over which their speed changes

    def add_to(self, moves: Array) -> None:
        """Add to how far performers are moved, (performers, frames, 3), what these two lack [target file units]."""
        one, other = (
            replace(core, centres=core.centres + (moves[number] / self.unit)[:, None])
            for number, core in zip(self.numbers, self.cores, strict=True)
        )
        lack = np.maximum(one.way_from(other, self.along, FLESH) - self.allowed, 0.0)
        if lack.any():
            parted = by_shot(partial(_slowed, frames=self.soft), self.shots, lack, self.speed)
            for number, share in zip(self.numbers, (self.shares * [1.0, -1.0]).T, strict=True):
                moves[number] += self.unit * (share * parted)[:, None] * self.along


def _ways_between(contacts: SceneContacts, skins: Sequence[Skins | None], numbers: tuple[int, int]) -> Iterator[_Way]:
    """The ways in which two performers part: along the floor; or upwards, where one is on the trunk or the lap of the
    other, which then stays.
    """
    up, both = contacts.performers[0].clip.up, [contacts.performers[number] for number in numbers]
    pelvises = [one.clip.source.positions[:, one.clip.drivers[one.clip.pelvis]] @ up for one in both]
    if np.mean(np.subtract(*pelvises)) < 0.0:  # the first is the one that is higher
        numbers, both = numbers[::-1], both[::-1]
    own = [skin for number in numbers if (skin := skins[number])]
    source_unit, unit = (float(np.mean([getattr(skin, side).unit for skin in own])) for side in ("source", "target"))

    def cores(*parts: Flags) -> tuple[list[Core], list[Core]]:
        """Those of the sources, and those of the targets."""
        each = [*zip(both, own, parts, strict=True)]
        return (
            [Core.of(skin.source, one.clip.source, source_unit, some) for one, skin, some in each],
            [Core.of(skin.target, copy_on_path(one), unit, some) for one, skin, some in each],
        )

    shots, time = common_shots(both), both[0].clip.frame_time
    sources, targets = cores(IS_CORE, IS_CORE)
    between = level(np.subtract(*(core.centres.mean(axis=1) for core in targets)), up)
    between = by_shot(partial(averaged, reach=round(SOFT / time)), shots, between)
    aside = normalised(between) * smoothstep(lengths(between) / BESIDE)[:, None]
    upwards = np.broadcast_to(up, aside.shape)
    free = np.stack([_is_free(contacts, number) for number in numbers], axis=1).astype(float)
    steps = np.max([_steps(one.supports) for one in both], axis=0)
    speed = SPEED * time * np.maximum(steps, STANDING)
    way = partial(_Way, numbers, unit=unit, speed=speed, shots=shots, soft=SOFT / time)
    for of_source, of_target in ((sources, targets), cores(IS_SEAT, IS_THIGH)):
        to_part = [of_source[0].way_from(of_source[1], along, -TOUCH, -1.0) for along in (aside, upwards)]
        rests = by_shot(over_runs, shots, np.subtract(*to_part)[:, None], np.min(to_part, axis=0))[:, 0] > 0.0
        yield way(of_target, along=upwards, allowed=np.where(rests, 0.0, np.inf), shares=free * [1.0, 0.0])
        if of_target is targets:
            allowed = np.where(rests, np.inf, sources[0].way_from(sources[1], aside, 0.0))
            yield way(targets, along=aside, allowed=allowed, shares=free / np.maximum(free.sum(axis=1)[:, None], 1.0))


def _slowed(ways: Array, speed: Array, frames: float) -> Array:
    """(frames,), the least that is nowhere less than ways, (frames,), and changes no faster than `speed`, (frames,), a
    frame; then smoothed over about `frames` on each side.
    """
    s = np.cumsum(speed)
    before = np.maximum.accumulate(ways + s) - s
    after = (np.maximum.accumulate((ways - s)[::-1]) + s[::-1])[::-1]
    return widened(np.maximum(before, after)[:, None], frames)[:, 0]


def _steps(supports: Supports) -> Array:
    """(frames,), 0 while both feet rest, blended to 1."""
    legs = supports.weights[:, : supports.feet].reshape(len(supports.weights), -1, 2)
    return np.asarray(1.0 - legs.max(axis=2).min(axis=1)) if legs.size else np.ones(len(legs))


def _is_free(contacts: SceneContacts, number: int) -> Flags:
    """(frames,), whether a performer can move: in no frame of the shot, its trunk is on a prop that nobody holds."""
    one, sits = contacts.performers[number], np.zeros((len(contacts.performers[number].clip), 1))
    names = np.array(one.clip.regions.names)
    for k, prop in enumerate(contacts.props):
        near = contacts.on_props[number, k]
        of_trunk = np.isin(names[one.clip.regions.of_joint[near.joints]], TRUNK_REGIONS)
        if not prop.grips:
            sits = np.maximum(sits, near.f[:, of_trunk].max(axis=1, initial=0.0)[:, None])
    return by_shot(lambda each: np.full(len(each), not each.any()), one.clip.shots, sits)
