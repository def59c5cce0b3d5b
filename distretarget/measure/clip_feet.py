"""Faults of feet: those that skate, and joints that go below the floor on which feet rest."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from distretarget.body.body import Body
from distretarget.body.limbs import Leg
from distretarget.body.resting import feet_at_rest
from distretarget.measure.faults import KINDS, Finding, Findings
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import heights_of
from distretarget.numerics.time_series import Shots, spans_of
from distretarget.numerics.vectors import lengths, level

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LOW = 0.04  # a foot stands if ankle and toe are this near to their lowest heights [leg lengths] ...
LOWEST = 2.0  # which are this percentile of them [%],
LEVEL_SPEED = 0.1  # and rise or sink slower than this [leg lengths / s];
SLIDES = 0.35  # it skates if they are faster than this along the floor [leg lengths / s] ...
SKATE = 0.2  # for at least this time [s]
TERRAIN = 0.15  # feet that rest at heights that differ by more than this are not on one floor [leg lengths]
SPAN = 0.05  # speeds of feet are means over this time before and after a frame [s]
STILL = 0.1  # a foot joint slower than this stands on something [leg lengths / s]
LIKELY = 10  # no fewer resting frames show where the floor is


def faults_of_feet(motion: Motion, body: Body, shots: Shots, joints: NDArray[np.intp]) -> Findings:
    """Return what is wrong with the feet of a body, which has some `joints`, and with how they stand on the floor."""
    if body.legs is None:
        return {}
    up, leg = body.up_vector, body.leg_length
    findings = {"off_floor": Finding(abs(body.lowest(up)) / leg)}
    skates = np.stack([_skates(motion, foot, up, leg, shots) for foot in body.legs], axis=1)
    time = float(skates.any(axis=1).sum() * motion.frame_time)
    if time:
        spans = max(
            ((*span, foot) for foot in (0, 1) for span in spans_of(skates[:, foot])), key=lambda span: span[1] - span[0]
        )
        findings["skating"] = Finding(time, int(spans[0]), body.skeleton.keys[body.legs[spans[2]].ankle])
    else:
        findings["skating"] = Finding(0.0)
    if (below := _below_floor(motion, body, joints)) is not None:
        findings["below_floor"] = below
    return findings


def _below_floor(motion: Motion, body: Body, joints: NDArray[np.intp]) -> Finding | None:
    """How deep joints go below the floor on which feet rest, while no foot stands lower; None if no foot rests, or if
    they rest at several heights.
    """
    rests, up, leg = [*_rests(motion, body)], body.up_vector, body.leg_length
    if not rests or max(high - low for low, _, high in rests) > TERRAIN * leg:
        return None
    floor = min(usual for _, usual, _ in rests)
    ends = _ends(body)
    lowest = heights_of(motion.positions, joints, up)
    stands = (_mean_speeds(motion.positions[:, ends], motion.frame_time) < STILL * leg) & (
        heights_of(motion.positions, ends, up) < floor - 0.01 * KINDS["below_floor"].limit * leg
    )
    lowest[stands.any(axis=1)] = np.inf
    frame, joint = np.unravel_index(lowest.argmin(), lowest.shape)
    depth = max(100.0 * float(floor - lowest[frame, joint]) / leg, 0.0)
    return Finding(depth, int(frame) if depth else None, body.skeleton.keys[joints[joint]] if depth else "")


def _ends(body: Body) -> NDArray[np.intp]:
    """Ankles and toes."""
    return np.array(sorted({joint for foot in body.legs or () for joint in (foot.ankle, foot.toe)}), np.intp)


def _mean_speeds(paths: Array, frame_time: float) -> Array:
    """(frames, joints), the speeds of paths, (frames, joints, n), as means over `SPAN` before and after a frame."""
    frames, reach = np.arange(len(paths)), max(round(SPAN / frame_time), 1)
    before, after = np.maximum(frames - reach, 0), np.minimum(frames + reach, len(paths) - 1)
    times = np.maximum(after - before, 1) * frame_time
    return np.asarray(lengths(paths[after] - paths[before]) / times[:, None])


def _skates(motion: Motion, foot: Leg, up: Array, leg: float, shots: Shots) -> Flags:
    """(frames,), whether a foot stands and moves along the floor."""
    ends = np.array(sorted({foot.ankle, foot.toe}), np.intp)
    heights = heights_of(motion.positions, ends, up) / leg
    low = (heights - np.percentile(heights, LOWEST, axis=0) < LOW).all(axis=1)
    rises = _mean_speeds(heights[..., None], motion.frame_time).max(axis=1)
    along = _mean_speeds(level(motion.positions[:, ends], up) / leg, motion.frame_time).min(axis=1)
    skates: Flags = low & (rises < LEVEL_SPEED) & (along > SLIDES) & ~_near_cut(shots, motion.frame_time)
    for start, end in spans_of(skates):
        if (end - start) * motion.frame_time < SKATE:
            skates[start:end] = False
    return skates


def _near_cut(shots: Shots, frame_time: float) -> Flags:
    """(frames,), whether a cut is within `SPAN` of a frame."""
    near, reach = np.zeros(len(shots), bool), max(round(SPAN / frame_time), 1)
    for edge in np.flatnonzero(np.diff(shots)) + 1:
        near[max(edge - reach, 0) : edge + reach] = True
    return near


def _rests(motion: Motion, body: Body) -> Iterator[tuple[float, float, float]]:
    """For each foot joint that rests often: a low, its usual and a high height while it rests [file units]."""
    for foot in body.legs or ():
        rests = feet_at_rest(motion, foot, body.up_vector, body.leg_length)
        heights = heights_of(motion.positions, [foot.ankle, foot.toe], body.up_vector)
        for of_joint, at_rest in zip(heights.T, rests.T, strict=True):
            if at_rest.sum() >= LIKELY:
                low, usual, high = np.percentile(of_joint[at_rest], (10, 50, 90))
                yield float(low), float(usual), float(high)
