"""Gaps between two performers of a scene or a performer and a prop: between joints that touch, and between skins."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from distretarget.errors import counted
from distretarget.matching.matching import Matching
from distretarget.measure.skin import Skin
from distretarget.measure.skin_depths import LIMBS, PARTS, PLACE_OF, find_depths
from distretarget.measure.skin_touches import FARTHEST, TOUCHING
from distretarget.motion import Motion
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.vectors import Array, lengths
from distretarget.skin.capsules import SEGMENTS

TOUCH_DISTANCE = 0.07  # joints touch where they are nearer than this in the source, or in scene A [leg lengths]


@dataclass(frozen=True, eq=False, kw_only=True)
class ScenePart:
    """A body, a region of a body, or a prop in two scenes, A and B; gaps are those between their joints."""

    a: Array  # (frames, joints, 3), positions in A [file units]
    b: Array  # (frames, joints, 3), positions in B [file units]
    keys: tuple[str, ...]  # of the joints in A
    leg: float = 0.0  # the length of the performer's leg in A [file units]; 0 for a prop
    region: str = ""  # its name; empty for a body or a prop


def body_part(matching: Matching, a: Array, b: Array, region: int | None = None) -> ScenePart:
    """Return the driven joints of a body, or of one of its regions, at positions `a` of source and `b` of target."""
    joints, regions = matching.body_joints, matching.regions
    if region is not None:
        joints = joints[regions.of_joint[joints] == region]
    drivers = matching.drivers[joints]
    keys = tuple(matching.source.skeleton.keys[joint] for joint in drivers)
    name = "" if region is None else regions.names[region]
    return ScenePart(a=a[:, drivers], b=b[:, joints], keys=keys, leg=matching.leg_lengths[0], region=name)


class Gap(NamedTuple):
    """The gap between two parts that touch in scene A, over all pairs of joints and frames in which they touch.

    Gaps are in leg lengths of A, the mean of both performers; those of B are scaled to A's world.

    Attributes:
        between: the numbers of two performers, or of a performer and a prop; performers are counted before props.
        regions: the region of the body of each, such as "left hand"; empty for a whole body or a prop.
        frames: the number of frames in which they touch.
        pairs: the number of pairs of joints that touch, summed over frames.
        a, b: the mean gap in A and in B.
        worst: the gap in B that 1 in 100 exceeds.
        error: the mean |gap in B - gap in A|.
        worst_frame: the frame with the largest difference.
        joints: the keys of the two joints of A with the largest difference.
    """

    between: tuple[int, int]
    regions: tuple[str, str]
    frames: int
    pairs: int
    a: float
    b: float
    worst: float
    error: float
    worst_frame: int
    joints: tuple[str, str]


def measure_gap(between: tuple[int, int], one: ScenePart, other: ScenePart, scale: float) -> Gap | None:
    """Measure the gap between two parts; None if they do not touch in A. `scale` is in units of B per unit of A."""
    legs = [part.leg for part in (one, other) if part.leg]
    leg = sum(legs) / max(len(legs), 1)
    touching = []
    for block in blocks_of(len(one.a)):
        frames, u, v = np.nonzero(lengths(one.a[block][:, :, None] - other.a[block][:, None]) < TOUCH_DISTANCE * leg)
        touching.append((block.start + frames, u, v))
    frames, u, v = (np.concatenate(values) for values in zip(*touching, strict=True))
    if not len(frames):
        return None
    a = lengths(one.a[frames, u] - other.a[frames, v]) / leg
    b = lengths(one.b[frames, u] - other.b[frames, v]) / (scale * leg)
    error = np.abs(b - a)
    farthest, count = error.argmax(), len(np.unique(frames))
    means = float(a.mean()), float(b.mean()), float(np.percentile(b, 99)), float(error.mean())
    joints = one.keys[u[farthest]], other.keys[v[farthest]]
    return Gap(between, (one.region, other.region), count, len(frames), *means, int(frames[farthest]), joints)


def measure_gaps(
    bodies: Sequence[Sequence[ScenePart]], props: Sequence[tuple[ScenePart, float]], scale: float
) -> Iterator[tuple[tuple[int, int], Gap | None]]:
    """Measure the gaps between each two `bodies`, in parts, and each body and prop, with the numbers of both."""
    pairs = [((i, j), one, other, scale) for (i, one), (j, other) in combinations(enumerate(bodies), 2)]
    for (i, body), (k, (prop, own)) in product(enumerate(bodies), enumerate(props, len(bodies))):
        pairs.append(((i, k), body, [prop], own))
    for between, ones, others, each in pairs:
        for one, other in product(ones, others):
            yield between, measure_gap(between, one, other, each)


class SkinContact(NamedTuple):
    """A hand or forearm of one performer that touches the other in the source."""

    frame: int  # of the clip
    error: float  # of the gap in the result; if the source's is below 0, all from it to 0 are right [% of height]
    parts: tuple[str, str]  # the parts of the first and the second performer that touch


class SkinContacts(NamedTuple):
    """The contacts between the skins of two performers, and their errors."""

    touches: tuple[SkinContact, ...]  # one or more
    frames: int  # the number of frames in which they touch
    error: float  # the mean error of the touches [% of height]
    worst: SkinContact  # the touch with the largest error

    @property
    def sentence(self) -> str:
        """The line that the command prints."""
        return (
            f"contacts in {counted(self.frames, 'frame')}: gaps between the skins off by {self.error:.1f} % of "
            f"height on average, worst in frame {self.worst.frame} ({' - '.join(self.worst.parts)})"
        )


class Overlap(NamedTuple):
    """Where two performers overlap most."""

    depth: float  # of a point of one below the surface of the other [% of height]
    frame: int  # of the clip
    parts: tuple[str, str]  # of the first and the second performer

    @property
    def sentence(self) -> str:
        """The line that the command prints."""
        parts = " - ".join(self.parts)
        return f"the bodies overlap by up to {self.depth:.1f} % of the height, most in frame {self.frame} ({parts})"


def measure_overlap(motions: Sequence[Motion], skins: Sequence[Skin]) -> Overlap:
    """Measure the largest depth of hands, forearms, upper arms, legs and heads of two performers in each other."""
    deepest = Overlap(0.0, 0, ("", ""))
    for one, other in ((0, 1), (1, 0)):
        bodies = [(motions[body], skins[body]) for body in (one, other)]
        for block in blocks_of(len(motions[0])):
            depths = -_gaps(bodies, block, 0.0, len(PARTS))
            frame, part, segment = np.unravel_index(depths.argmax(), depths.shape)
            if (depth := float(depths[frame, part, segment])) > deepest.depth:
                own, others = str(PARTS[part]), str(SEGMENTS[segment])
                deepest = Overlap(depth, block.start + int(frame), (own, others) if one == 0 else (others, own))
    return deepest


def measure_skin_contacts(
    sources: Sequence[Motion], results: Sequence[Motion], source_skins: Sequence[Skin], skins: Sequence[Skin]
) -> SkinContacts | None:
    """Measure the gaps of two performers' skins in source and result, with the same frames; None where none touch."""
    touches: list[SkinContact] = []
    for one, other in ((0, 1), (1, 0)):
        before = [(sources[body], source_skins[body]) for body in (one, other)]
        bodies = [(results[body], skins[body]) for body in (one, other)]
        for block in blocks_of(len(sources[0])):
            gaps = _gaps(before, block, 2.0 * TOUCHING)  # larger ones are given as this
            touching = gaps < TOUCHING
            if not touching.any():
                continue
            after = _gaps(bodies, block, FARTHEST)
            for frame, limb in zip(*np.nonzero(touching.any(axis=2)), strict=True):
                part = int(gaps[frame, limb].argmin())
                gap = gaps[frame, limb, part]
                result = after[frame, limb][PLACE_OF[part] == PLACE_OF].min()
                error = float(max(result - max(gap, 0.0), gap - result, 0.0))
                names = str(LIMBS[limb]), str(SEGMENTS[part])
                touches.append(SkinContact(block.start + int(frame), error, names if one == 0 else names[::-1]))
    if not touches:
        return None
    errors = [touch.error for touch in touches]
    frames, worst = len({touch.frame for touch in touches}), touches[int(np.argmax(errors))]
    return SkinContacts(tuple(touches), frames, float(np.mean(errors)), worst)


def _gaps(bodies: Sequence[tuple[Motion, Skin]], frames: slice, farthest: float, count: int = len(LIMBS)) -> Array:
    """(frames, count, segments), gaps of the first parts of one body to the other, at most `farthest` [% of height]."""
    (motion, skin), (other, other_skin) = bodies
    solids = other_skin.solids.of_second_body(len(motion.skeleton))
    height = (skin.height + other_skin.height) / 2.0
    exists = np.isin(np.arange(len(SEGMENTS)), solids.groups[:-1, 1])
    reach = np.full((1, len(PARTS), len(SEGMENTS)), -np.inf)
    reach[:, :count, exists] = farthest / 100.0 * height
    posed = (
        np.concatenate([each.positions[frames] for each in (motion, other)], axis=1),
        np.concatenate([each.world_rotations_in(frames) for each in (motion, other)], axis=1),
    )
    depths = find_depths(skin.patches, solids, posed, reach)[0][:, :count]
    return np.where(exists, -100.0 / height * depths, np.inf)
