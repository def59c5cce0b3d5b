"""Fits capsules to a mesh by its skin weights.

The cross-section of a part of a body is taken as 2 a wide and 2 b high, a >= b. If it is nearly round, the part gets
one capsule, else several side by side, with axes b from its edges. Their radii are such that they cover the share
`COVERED` of the surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from distretarget.numerics.vectors import Array, Flags, Numbers, cross, lengths, level, normalised
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import GROUP, SEGMENTS, Capsules, no_capsules
from distretarget.skin.mesh import SkinnedMesh

MOST_POINTS = 30_000  # that the mesh is sampled with
FEWEST_POINTS = 6  # of a part that gets capsules, or of half of it
QUARTERS = np.array([[2, 2, 2], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6  # the middles of a triangle's four quarters
EDGES = 3.0, 97.0  # percentiles of the surface at which a part ends [%]
COVERED = 0.7  # of the surface of a part [0 to 1]
COVERED_HARD = 0.85  # the same of hands and heads, which are hard
ROUND = 1.25  # of most parts, see `Part`
DENT = 0.25  # how deep the dents between capsules side by side may be [radii]
SIDES_OF_LEG, LEVELS_OF_LEG = 12, 8  # cells round and along a leg, in each of which skin is told from cloth
CLOTH = 1.6  # points farther than this from a leg's bone are cloth [distance of the skin there]
# Points of rigid pieces that are farther than `OFF_SKIN` from the skin of trunk and head are a hat's brim, a cape or a
# scabbard. If all pieces are rigid, the skin is one with at least the share `LEAST_SKIN` of the largest one's area.
LEAST_SKIN = 0.1
OFF_SKIN = 0.6  # [mean distance of the skin from the axis]
PASSES = 3  # over all parts, as the radii of each depend on those of its neighbours
ROUNDS = 10  # of least squares
SMOOTH = 0.01  # distances off the surface below this have the same weight [mean distances to the axis]
FLAT = 0.02  # weight of a slope of 1 of the radii along the axis [of the whole surface]
THINNEST = 0.1  # least radius [mean distances to the axis]


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a body whose capsules one joint carries."""

    carrier: int  # the joint that carries the capsules
    joints: Sequence[int]  # joints whose surface belongs to the part
    segment: int  # an index of `SEGMENTS`
    tip: int | None = None  # the joint at the end of its bone; None for a part that ends where its surface does
    parent: int | None = None  # the carrier of the part that gets the surface beyond the carrier, seen from the tip
    axis: Array | None = None  # (3,), along a part without a tip in the rest pose; None: to the middle of its surface
    level: Array | None = None  # (3,), the unit vector that the axis is perpendicular to; None for any
    across: Array | None = None  # (3,), the direction in which it is wide; None to find it from the surface
    closed: tuple[bool, bool] = (True, True)  # whether the surface is closed at its start and at its end
    most: int = 3  # the number of capsules side by side, at most
    is_leg: bool = False  # whether skirts and coats may hang round it
    is_dressed: bool = False  # whether hats, capes and scabbards may stand off it
    round: float = ROUND  # a cross-section is round if it is not more than this times as wide as high
    covered: float = COVERED  # the share of its surface that its capsules cover


@dataclass(frozen=True, eq=False)
class _Surface:
    """Points on a surface, (points, 3), and the area and the index of the piece of the mesh of each, (points,)."""

    points: Array
    areas: Array
    pieces: Numbers

    def percentile(self, values: Array, percent: float) -> float:
        """Return the percentile of the values of points, (points,), weighted by their areas."""
        order = values.argsort()
        below = np.cumsum(self.areas[order])
        return float(np.interp(0.01 * percent * below[-1], below - 0.5 * self.areas[order], values[order]))

    @classmethod
    def joined(cls, surfaces: Sequence[_Surface]) -> _Surface:
        """Return the points of several surfaces as one."""
        columns = zip(*((each.points, each.areas, each.pieces) for each in surfaces), strict=True)
        return cls(*map(np.concatenate, columns))

    def part(self, chosen: Flags) -> _Surface:
        """Return some of the points."""
        return _Surface(self.points[chosen], self.areas[chosen], self.pieces[chosen])


def fit_capsules(mesh: SkinnedMesh, skeleton: Skeleton, parts: Sequence[Part]) -> Capsules:
    """Return the capsules of the parts of a body; a part with hardly any surface has none."""
    surface, owners = _sampled(mesh, len(skeleton), parts)
    rest = skeleton.rest_positions
    bends = _bend(surface.pieces, owners)
    owners = _owners_at_joints(surface, owners, parts, rest)
    found, covered = [], []
    for number, part in enumerate(parts):
        own = surface.part(owners == number)
        if len(own.points) >= FEWEST_POINTS:
            own = replace(own, points=own.points - rest[part.carrier])
            tip = None if part.tip is None else rest[part.tip] - rest[part.carrier]
            axes = _axes(own, part, tip)
            own = own if tip is None or not part.is_leg else _under_cloth(own, axes, float(np.linalg.norm(tip)))
            own = _near_skin(own, bends, axes) if part.is_dressed else own
            ends, radii = _fitted(own, axes, part, tip)
            carriers, segments = np.full(len(ends), part.carrier), np.full(len(ends), part.segment)
            found.append((carriers, ends, radii, segments))
            covered.append((part, replace(own, points=own.points + rest[part.carrier])))
    if not found:
        return no_capsules()
    capsules = Capsules(*(np.concatenate(column) for column in zip(*found, strict=True)))
    return _covering_together(capsules, covered, capsules.ends + rest[capsules.joints, None])


def _covering_together(capsules: Capsules, covered: Sequence[tuple[Part, _Surface]], ends: Array) -> Capsules:
    """The capsules with radii changed so that the union of a group's capsules covers the wanted share of the surface of
    each segment; fitted one by one they cover more. Feet do not change. `ends`, (capsules, 2, 3), are those of the
    capsules' axes in the rest pose.
    """
    radii, groups, whole = capsules.radii.copy(), GROUP[capsules.segments], []
    for segment in np.unique(capsules.segments).tolist():
        own = [(part.covered, surface) for part, surface in covered if part.segment == segment]
        if "foot" not in SEGMENTS[segment]:
            whole.append((segment, own[0][0], _Surface.joined([surface for _, surface in own])))
    for _ in range(PASSES):
        for segment, share, surface in whole:
            near, on = groups == GROUP[segment], capsules.segments == segment
            away, _ = distances(surface.points, ends[near], radii[near])
            radii[on] += surface.percentile(away, 100.0 * share)
            radii[on] = np.maximum(radii[on], THINNEST * capsules.radii[on])
    return replace(capsules, radii=radii)


def _sampled(mesh: SkinnedMesh, joints: int, parts: Sequence[Part]) -> tuple[_Surface, Numbers]:
    """Points spread over the mesh, at the centroids of its triangles, or of the quarters of these if triangles are few;
    and for each the index of the part with the largest weight, (points,), -1 for points that belong to no part.
    """
    triangles = mesh.triangles[:: max(-(-len(mesh.triangles) // MOST_POINTS), 1)]
    part_of = np.full(joints, -1)
    for number, part in enumerate(parts):
        part_of[list(part.joints)] = number
    corners = mesh.vertices[triangles]
    areas = 0.5 * lengths(cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    quarters = QUARTERS if 4 * len(triangles) <= MOST_POINTS else QUARTERS[:1]
    points = np.einsum("qc,tci->tqi", quarters, corners).reshape(-1, 3)
    many = len(quarters)
    surface = _Surface(points, np.repeat(areas / many, many), np.repeat(mesh.pieces[triangles[:, 0]], many))
    owned = np.repeat(mesh.owners(part_of, triangles), many)
    owned[surface.areas <= 0.0] = -1
    return surface, owned


def _bend(pieces: Numbers, owners: Numbers) -> Flags:
    """(pieces,), whether a piece of a mesh moves with several parts, by pieces and parts of points, (points,) each."""
    known = np.unique(np.stack([pieces, owners])[:, owners >= 0], axis=1)
    return np.asarray(np.bincount(known[0], minlength=pieces.max(initial=-1) + 1) > 1)


def _owners_at_joints(surface: _Surface, owners: Numbers, parts: Sequence[Part], rest: Array) -> Numbers:
    """The part of each point, (points,), where points beyond the joint of a part, seen from its tip, go to the part's
    parent: the flanks above the hip joints move with the thighs, but belong to the pelvis.
    """
    owners, carriers = owners.copy(), [part.carrier for part in parts]
    for number, part in enumerate(parts):
        if part.parent in carriers and part.tip is not None:
            along = (surface.points - rest[part.carrier]) @ (rest[part.tip] - rest[part.carrier])
            owners[(along < 0.0) & (owners == number)] = carriers.index(part.parent)
    return owners


def _fitted(surface: _Surface, axes: Array, part: Part, tip: Array | None) -> tuple[Array, Array]:
    """The ends, (capsules, 2, 3), and radii, (capsules, 2), of the capsules of a part, from its surface and its axes,
    as by `_axes`; surface, tip and ends are relative to the carrier.
    """
    along, wide, high = (surface.points @ axes).T
    reach = [surface.percentile(along, percent) for percent in EDGES]
    low, top = reach if tip is None else (0.0, float(np.linalg.norm(tip)))
    halves = [along <= 0.5 * (low + top), along >= 0.5 * (low + top)]
    halves = [half if half.sum() >= FEWEST_POINTS else np.ones(len(along), bool) for half in halves]
    w, a = np.transpose([_width(surface, wide, half) for half in halves])
    h, b = np.transpose([_width(surface, high, half) for half in halves])
    if a.sum() < b.sum():
        axes, w, a, h, b = axes[:, [0, 2, 1]], h, b, w, a
    many = _count(a.max(), b.mean(), part)
    starts = np.array([low + part.closed[0] * b[0], top - part.closed[1] * b[1]])
    if tip is None and starts[0] > starts[1]:
        starts[:] = starts.mean()
    ends = np.empty((many, 2, 3))
    for end in range(2):
        spread = np.linspace(-1.0, 1.0, many) * max(a[end] - b[end], 0.0) if many > 1 else np.zeros(1)
        sides = np.stack([np.full(many, starts[end]), w[end] + spread, np.full(many, h[end])])
        ends[:, end] = (axes @ sides).T
    return ends, np.tile(_covering(surface, ends, part.covered), (many, 1))


def _under_cloth(surface: _Surface, axes: Array, length: float) -> _Surface:
    """The inner layer of a surface round a bone: points much farther out than others on the same side of the bone at
    the same height belong to a skirt or a coat. Points beyond the ends of the bone are compared with those at the ends.
    """
    along, wide, high = (surface.points @ axes).T
    away = np.hypot(wide, high)
    side = np.floor(SIDES_OF_LEG * (np.arctan2(high, wide) / (2.0 * np.pi) + 0.5)).astype(int)
    level = np.clip(LEVELS_OF_LEG * along / max(length, 1e-300), 0, LEVELS_OF_LEG - 1).astype(int)
    cell = side + (SIDES_OF_LEG + 1) * level
    least = np.full(cell.max() + 1, np.inf)
    np.minimum.at(least, cell, away)
    return surface.part(away <= CLOTH * least[cell])


def _near_skin(surface: _Surface, bends: Flags, axes: Array) -> _Surface:
    """The surface round a joint without points that stand off the skin. Skin are the pieces that bend, a mask, (pieces
    of the mesh,), else the piece nearest to the joint; and all pieces that are mostly near skin.
    """
    areas, away = np.bincount(surface.pieces, surface.areas, len(bends)), lengths(surface.points)
    near: Flags = np.ones(len(away), bool)
    are_skin, before = bends & (areas > 0.0), 0
    if not are_skin.any():
        large = np.flatnonzero(areas >= LEAST_SKIN * areas.max())
        medians = [surface.part(on).percentile(away[on], 50.0) for on in (surface.pieces == piece for piece in large)]
        are_skin[large[np.argmin(medians)]] = True
    skin = surface.part(are_skin[surface.pieces])
    off = (skin.points - np.average(skin.points, axis=0, weights=skin.areas)) @ axes[:, 1:]
    far = OFF_SKIN * np.average(lengths(off), weights=skin.areas)
    while before < (before := are_skin.sum()):
        near = np.asarray(KDTree(surface.points[are_skin[surface.pieces]]).query(surface.points)[0] <= far)
        are_skin |= np.bincount(surface.pieces, surface.areas * near, len(bends)) > 0.5 * areas
    return surface.part(near)


def _axes(surface: _Surface, part: Part, tip: Array | None) -> Array:
    """The unit vectors along a part, across its wide side, and across its narrow side, as columns, (3, 3)."""
    along = tip if tip is not None and tip.any() else part.axis
    middle = np.average(surface.points, axis=0, weights=surface.areas)
    along = middle if along is None else along
    if part.level is not None:
        along = along - (along @ part.level) * part.level
    along = normalised(along) if along.any() else np.array([0.0, 1.0, 0.0])
    across = part.across
    if across is None:
        flat = level(surface.points - middle, along)
        across = np.linalg.eigh((surface.areas[:, None] * flat).T @ flat)[1][:, 2]
    across = normalised(across - (across @ along) * along)
    return np.stack([along, across, np.cross(along, across)], axis=1)


def _width(surface: _Surface, values: Array, chosen: Flags) -> tuple[float, float]:
    """The middle and half the width of the range of values of the chosen points, between the percentiles `EDGES`."""
    low, top = (surface.part(chosen).percentile(values[chosen], percent) for percent in EDGES)
    return 0.5 * (low + top), 0.5 * (top - low)


def _count(wide: float, high: float, part: Part) -> int:
    """The number of capsules side by side for a cross-section, given by half its width and height."""
    if wide <= part.round * high:
        return 1
    gap = 2.0 * high * np.sqrt(1.0 - (1.0 - DENT) ** 2)
    return min(1 + int(np.ceil(2.0 * (wide - high) / max(gap, 1e-9 * wide))), part.most)


def _covering(surface: _Surface, ends: Array, covered: float) -> Array:
    """The radii, (2,), at the ends of axes side by side, (capsules, 2, 3), that cover a share of a surface: quantile
    regression of distances by iteratively reweighted least squares (E. J. Schlossmacher, 1973).
    """
    away, at = distances(surface.points, ends, np.zeros((len(ends), 2)))
    shares, scale = np.stack([1.0 - at, at], axis=1), float(away.mean())
    if scale == 0.0:
        return np.zeros(2)
    radii = np.full(2, surface.percentile(away, 100.0 * covered))
    slope = (scale / max(float(lengths(ends[:, 1] - ends[:, 0]).mean()), SMOOTH * scale)) ** 2
    for _ in range(ROUNDS):
        off = away - shares @ radii
        weights = surface.areas * np.where(off > 0.0, covered, 1.0 - covered) / np.maximum(np.abs(off), SMOOTH * scale)
        flat = FLAT * slope * weights.sum() * np.array([[1.0, -1.0], [-1.0, 1.0]])
        square = shares.T @ (weights[:, None] * shares) + flat
        radii = np.linalg.solve(square, shares.T @ (weights * away))
    return np.asarray(np.maximum(radii, THINNEST * scale))


def distances(points: Array, ends: Array, radii: Array) -> tuple[Array, Array]:
    """Return the signed distances of points, (..., points, 3), from the union of capsules with these ends, (...,
    capsules, 2, 3), negative inside, and the fractions along the axis of the nearest capsule, (..., points) each.
    """
    start, bone = ends[..., None, :, 0, :], (ends[..., 1, :] - ends[..., 0, :])[..., None, :, :]
    squares = np.maximum((bone**2).sum(axis=-1), 1e-300)
    at = np.clip(((points[..., None, :] - start) * bone).sum(axis=-1) / squares, 0.0, 1.0)
    nearest = start + at[..., None] * bone
    away = np.linalg.norm(points[..., None, :] - nearest, axis=-1) - radii[:, 0] - at * (radii[:, 1] - radii[:, 0])
    which = away.argmin(axis=-1)[..., None]
    return np.take_along_axis(away, which, axis=-1)[..., 0], np.take_along_axis(at, which, axis=-1)[..., 0]
