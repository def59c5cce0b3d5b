"""What joints that touch fell short of their places in a sweep, made up for in the next.

A body of finite stiffness stops short of the places that its springs draw it to. The next sweep draws it further by as
much, as the method of multipliers does (M. J. D. Powell, A method for nonlinear constraints in minimization problems,
1969). Each region of the body counts as a whole: a hand that holds a larger one cannot have all its joints in their
places, and drawing further would only tear at it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from distretarget.baseline.rotation_copy import RootScale
from distretarget.ik.springs import Springs
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.time_series import Shots
from distretarget.numerics.vectors import lengths
from distretarget.objectives.contact_pairs import (
    FADE,
    activation,
    activation_window,
    come_near,
    normalised_distances,
    pair_stiffness,
    share_across,
)
from distretarget.objectives.settings import ContactSettings

Array = NDArray[np.float64]

MOST = 0.01  # joints are drawn no further beyond their places: what is out of reach stays so [body units]
NO_STIFFNESS = 1e-12  # a smaller stiffness is none


def with_shortfall(springs: Springs, before: Springs, x: Array, regions: NDArray[np.intp]) -> Springs:
    """Return the springs of the next sweep, drawing further by what the regions fell short in the last.

    `before` are the springs of the last sweep, on the same joints, and `x`, (frames, joints, 3), the positions that
    they led to [body units]; `regions` are of all joints.
    """
    short = before.rest - x[:, before.a]
    weights = np.trace(before.A, axis1=-2, axis2=-1)[..., None]
    rest = np.array(springs.rest)
    for region in np.unique(regions[before.a]):
        of_region = regions[before.a] == region
        total = weights[:, of_region].sum(axis=1)
        mean = (weights[:, of_region] * short[:, of_region]).sum(axis=1) / np.maximum(total, NO_STIFFNESS)
        mean *= np.minimum(MOST / np.maximum(lengths(mean), NO_STIFFNESS), 1.0)[:, None]
        rest[:, of_region] += mean[:, None]
    return springs._replace(rest=rest)


Joints = NDArray[np.intp]

FIRMER = 2.0  # times as stiff as a pair within a body at D = `settings.close` ...
NEAREST = 0.01  # [D] ... and more for nearer pairs, up to those nearer than this
LEAST_STIFFNESS = 0.05  # of a pair that counts
NO_STIFFNESS = 1e-12  # stiffness beside which none is zero: where nothing draws, any place will do


@dataclass(frozen=True, eq=False)
class Points:
    """The joints of a performer that may touch another performer.

    Attributes:
        joints: (points,), joints of the target.
        source: (frames, points, 3), where their drivers are in the source's world [source file units].
        reach: (points,), path lengths from the pelvis to them in the source [source file units].
        target_reach: (points,), the same on the target [target file units].
        shots: (frames,), the shots of the clip.
    """

    joints: Joints
    source: Array
    reach: Array
    target_reach: Array
    shots: Shots


@dataclass(frozen=True, eq=False, kw_only=True)
class Touching:
    """The pairs of joints of two performers that are near each other, one entry for each pair and frame.

    Attributes:
        frames: (entries,), the frame.
        joints: (2, entries), the joint of each performer.
        f: (entries,), how far the pair has set in, 0 to 1.
        w: (entries,), its stiffness.
        vectors: (entries, 3), from the second to the first joint in the source, scaled [target file units].
    """

    frames: NDArray[np.intp]
    joints: Joints
    f: Array
    w: Array
    vectors: Array


def find_touching(
    one: Points, other: Points, scale: RootScale, up: Array, frame_time: float, settings: ContactSettings
) -> Touching:
    """Return the pairs of joints of two performers that are near each other.

    Their vectors have the `scale` of the world, `up` being the unit vector up in it; or that of Eq. (1), with the path
    lengths of both bodies, if it is less: where legs make the world larger than arms are long, hands that touch do not
    part.
    """
    count, lead = len(one.source), settings.blend / frame_time
    found = [_found(one, other, block, lead, settings) for block in blocks_of(count)]
    frames, u, v, f, w, d = (np.concatenate(columns) for columns in zip(*found, strict=True))
    of_paths = (one.target_reach[u] + other.target_reach[v]) / (one.reach[u] + other.reach[v])
    vectors = np.minimum(of_paths / scale.level, 1.0)[:, None] * scale.places(d, up)
    return Touching(frames=frames, joints=np.stack([one.joints[u], other.joints[v]]), f=f, w=w, vectors=vectors)


def _found(
    one: Points, other: Points, block: slice, lead: float, settings: ContactSettings
) -> tuple[Joints, Joints, Joints, Array, Array, Array]:
    """The near pairs in a block of frames, an entry for each pair and frame: the frame, the number of either point, the
    activation, the stiffness, and the vector between them.
    """
    margin, shots = activation_window(lead), one.shots + other.shots  # a new shot at the cuts of either
    first = max(block.start - margin, 0)
    a, b = (points.source[first : block.stop + margin] for points in (one, other))
    reach = (settings.reach + FADE) * (one.reach[:, None] + other.reach)
    u, v = np.nonzero(reach > 0)
    on = come_near(a, b, u, v, reach[u, v])
    u, v = u[on], v[on]
    inside = slice(block.start - first, block.stop - first)
    D = normalised_distances(a, b, u, v, one.reach[u] + other.reach[v])
    f, D = (
        activation(D, shots[first : block.stop + margin], lead, settings.reach)[inside] if len(u) else D[inside],
        D[inside],
    )
    ends = u, v + len(one.joints)
    w = firmness(D, settings) * pair_stiffness(f, D, ends, len(one.joints) + len(other.joints), settings)
    frames, pairs = np.nonzero(w > LEAST_STIFFNESS)
    u, v = u[pairs], v[pairs]
    vectors = a[inside][frames, u] - b[inside][frames, v]
    return frames + block.start, u, v, f[frames, pairs], w[frames, pairs], vectors


def firmness(D: Array, settings: ContactSettings) -> Array:
    """How many times as stiff pairs across bodies are as pairs within a body, by their normalised distances D.

    Whole bodies have to move, and not only their limbs. The nearest pairs decide: where hands differ in size, those who
    hold each other cannot keep all distances between their joints.
    """
    return FIRMER * (settings.reach + NEAREST) / (D + NEAREST)


def gap_errors(touching: Touching, one: Array, other: Array) -> Array:
    """(entries,), how far the gap of each pair is off the length of its vector, given the positions of both performers,
    (frames, joints, 3) [target file units].
    """
    u, v = touching.joints
    return np.abs(lengths(one[touching.frames, u] - other[touching.frames, v]) - lengths(touching.vectors))


def touching_springs(
    touching: Touching,
    copies: tuple[Array, Array],
    now: tuple[Array, Array],
    units: tuple[float, float],
) -> tuple[Springs, Springs]:
    """The springs that draw the joints of either performer to where they touch, in its body units; their arrays have
    the frames in front.

    A joint that touches several others has one spring, with the sum of their energies. `copies` and `now` are the
    positions, (frames, joints, 3), of both performers in the copy and at present [target file units]; `units` are
    their body units.
    """
    (a, b), (c, d) = (
        (positions[touching.frames, joints] for positions, joints in zip(pair, touching.joints, strict=True))
        for pair in (copies, now)
    )
    delta = a - b + touching.f[:, None] * (touching.vectors - (a - b))
    length = lengths(touching.vectors)
    e = touching.vectors / np.maximum(length, 1e-12)[:, None]
    change = delta - (c - d)
    springs = []
    for joints, unit, present, sign in zip(touching.joints, units, (c, d), (1.0, -1.0), strict=True):
        k = np.asarray(share_across((length / unit) ** 2))
        places = (present + sign * unit / sum(units) * change) / unit
        springs.append(_gathered(touching, joints, k, e, places, len(now[0])))
    return springs[0], springs[1]


def _gathered(touching: Touching, joints: Joints, k: Array, e: Array, places: Array, count: int) -> Springs:
    """One spring for each joint, to the place where all of its own are in balance.

    These draw to `places`, (entries, 3), with the stiffness A = w (k I + (1 - k) e e^T); `count` is the number of
    frames.
    """
    touches = np.bincount(joints) > 0
    kept, column = np.flatnonzero(touches), np.cumsum(touches) - 1
    cell = touching.frames * len(kept) + column[joints]

    def summed(values: Array) -> Array:
        return np.bincount(cell, values, count * len(kept)).astype(np.float64).reshape(count, len(kept))

    across, along = touching.w * k, touching.w * (1.0 - k)
    pull = along * (e * places).sum(axis=1)
    A = summed(across)[..., None, None] * np.eye(3)
    Ay = np.stack([summed(across * places[:, i] + pull * e[:, i]) for i in range(3)], axis=-1)
    for i in range(3):
        for j in range(i + 1):
            A[..., i, j] += summed(along * e[:, i] * e[:, j])
            A[..., j, i] = A[..., i, j]
    balanced = np.linalg.solve(A + NO_STIFFNESS * np.eye(3), Ay[..., None])[..., 0]
    return Springs(kept, np.full(len(kept), -1), np.asarray(balanced, np.float64), A)
