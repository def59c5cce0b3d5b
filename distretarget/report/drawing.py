"""What the report on a clip draws: both motions, small enough to embed, and which joints touch in which frames.

Arrays are base64 of little-endian numbers.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.legs import Leg, leg_length
from distretarget.measure.contacts import CONTACT_DISTANCE, FAR_ALONG
from distretarget.measure.diff import Diff
from distretarget.measure.feet import LOWEST
from distretarget.motion import Motion
from distretarget.numerics.rotations import least_rotation
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]
Joints = NDArray[np.intp]

BUDGET = 5_000_000  # [bytes] most for the quantised positions of both motions; longer clips are drawn in part
STEPS = 65_535  # steps of a quantised coordinate across the bounding box
SAMPLES = 64  # frames from which the range of the differences of D is estimated


def diff_drawing(diff: Diff) -> dict[str, Any]:
    """The drawing data of a diff, with y up, the floor at 0, and twice the leg length as the unit of both motions.

    Not every frame is drawn where all would take more than `BUDGET`. Points are the joints that the matrices show, of A
    and B in the same order.
    """
    comparison, matching, contacts = diff.comparison, diff.matching, diff.comparison.contacts
    b_points, regions = contacts.candidates.points, matching.target.regions
    a_points = matching.drivers[b_points]
    step = drawn_step(len(diff), len(diff.a.skeleton) + len(diff.b.skeleton))
    legs = matching.legs or (None, None)
    resting = np.concatenate([comparison.feet.joints, comparison.supports.joints])
    rests = np.concatenate([comparison.feet.stance, comparison.supports.rest], axis=1)
    sizes = np.minimum(matching.target.skeleton.path_sizes[np.ix_(b_points, b_points)], 255)
    a_joints, b_joints = (a_points, matching.drivers[resting]), (b_points, resting)
    return {
        "step": step,  # every how many frames one is drawn
        "notes": _notes(step, diff),  # what a reader should know about the drawing
        "near": CONTACT_DISTANCE,  # two regions touch where D of their nearest points is below this ...
        "far_along": FAR_ALONG,  # ... and the path between these has at least this number of joints
        "regions": regions.of_joint[b_points].tolist(),  # of each point, -1 for none
        "neighbours": regions.neighbours.tolist(),  # (regions, regions), which are neighbours and never touch
        "foot_regions": [int(regions.of_joint[leg.ankle]) for leg in legs[1] or ()],  # do not touch while one rests
        "facing": _facing(diff),
        "a": _drawing(diff.a, matching.source.skeleton, legs[0], a_joints, diff.up, step),
        "b": _drawing(diff.b, matching.target.skeleton, legs[1], b_joints, diff.up, step),
        "bone_errors": in_base64(_bone_errors(diff, step), "<u1"),
        "pelvis": [int(matching.drivers[matching.pelvis]), matching.pelvis],  # its joint in A and in B
        "sizes": in_base64(sizes, "<u1"),  # (points, points), the numbers of joints on the paths between, at most 255
        "rests": in_base64(np.packbits(rests, axis=1, bitorder="little"), "<u1"),  # (frames, bytes), a bit a joint
        "largest_difference": _largest_difference(diff, a_points, b_points),  # where the colours of the matrices end
        "contacts": _contacts(diff, b_points.tolist()),  # in the order of the document
    }


def drawn_step(frames: int, joints: int) -> int:
    """Every how many frames one is drawn, so that the positions of the joints of both motions fit in `BUDGET`."""
    return max(1, -(-frames * joints * 3 * 2 // BUDGET))


def quantised(positions: Array) -> tuple[NDArray[np.int16], Array, Array]:
    """Positions (frames, joints, 3) as 16-bit numbers in their bounding box: the numbers, offset (3,), scale (3,).

    A position is offset + scale * number; the error is at most half a step, of which the box has `STEPS`.
    """
    low, high = positions.min(axis=(0, 1)), positions.max(axis=(0, 1))
    scale = (high - low) / STEPS
    numbers = np.rint((positions - low) / np.where(scale > 0, scale, 1.0)) - (STEPS + 1) // 2
    return numbers.astype(np.int16), low + scale * ((STEPS + 1) // 2), scale


def spans(mask: NDArray[np.bool_]) -> list[list[int]]:
    """The runs of true values in (frames,): the first frame of each run, and the frame after its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [[int(first), int(end)] for first, end in edges.reshape(-1, 2)]


def _drawing(
    motion: Motion, body: Skeleton, legs: Sequence[Leg] | None, joints: tuple[Joints, Joints], up: Array, step: int
) -> dict[str, Any]:
    """The drawing data of one motion; `body` is its skeleton with rigid bones, `joints` are its points, and the joints
    that rest in some frame of A: with legs first ankle and toe of each.
    """
    points, resting = joints
    unit = (2 * leg_length(body, legs) if legs else float(body.path_lengths.max())) or 1.0
    placed = upright(up).apply(motion.positions[::step].reshape(-1, 3)) / unit
    positions = placed.reshape(-1, len(body), 3)
    positions[..., 1] -= np.percentile(positions[..., 1].min(axis=1), LOWEST)
    return {
        "names": list(body.keys),
        "points": points.tolist(),
        "resting": resting.tolist(),
        "tau": in_base64(body.path_lengths[np.ix_(points, points)] / unit, "<f4"),  # (points, points), path lengths
        **packed(body, positions),
    }


def packed(skeleton: Skeleton, positions: Array) -> dict[str, Any]:
    """Positions (frames, joints, 3) in few bytes, as offset + scale * number, and the parents of the joints."""
    numbers, offset, scale = quantised(positions)
    return {
        "parents": skeleton.parents.tolist(),
        "offset": offset.tolist(),
        "scale": scale.tolist(),
        "positions": in_base64(numbers, "<i2"),
    }


def upright(up: Array) -> Rotation:
    """The rotation that turns `up`, (3,), to y."""
    return Rotation.from_quat(least_rotation(up[None], np.array([[0.0, 1.0, 0.0]]))[0])


def _facing(diff: Diff) -> float:
    """The direction that B faces in its first frame, as the angle about y from z [rad]; 0 if it has no legs."""
    if diff.matching.legs is None:
        return 0.0
    left, right = (diff.b.positions[0, leg.hip] for leg in diff.matching.legs[1])
    front = upright(diff.up).apply(np.cross(left - right, diff.up))
    return float(np.arctan2(front[0], front[2]))


def _bone_errors(diff: Diff, step: int) -> NDArray[np.float64]:
    """(drawn frames, joints of B), the direction error of the bone above each joint in half degrees; 255 for none."""
    errors = diff.comparison.direction_error[::step]
    coded = np.full((len(errors), len(diff.b.skeleton)), 255.0)
    coded[:, diff.comparison.bones] = np.minimum(np.rint(2 * errors), 254)
    return coded


def _contacts(diff: Diff, points: list[int]) -> list[dict[str, Any]]:
    """The regions that touch in A: their points that are nearest in the worst frame, and the spans of frames in which
    they touch in A and in B.
    """
    contacts, everything = diff.comparison.contacts, np.arange(len(diff.b.skeleton))
    frame, regions, _ = contacts.candidates.touching(diff.b, everything, diff.comparison.feet.stance)
    names = contacts.candidates.names
    return [
        {
            "pair": [points.index(touch.u), points.index(touch.v)],
            "a": spans(np.isin(np.arange(len(diff)), touch.frames)),
            "b": spans(np.isin(np.arange(len(diff)), frame[regions == names.index(touch.name)])),
        }
        for touch in contacts.touches
    ]


def _largest_difference(diff: Diff, a_points: Joints, b_points: Joints) -> float:
    """The 99.5th percentile of |D_a - D_b| over `SAMPLES` frames."""
    tau_a = diff.matching.source.skeleton.path_lengths[np.ix_(a_points, a_points)]
    tau_b = diff.matching.target.skeleton.path_lengths[np.ix_(b_points, b_points)]
    i, j = np.nonzero((tau_a > 0) & (tau_b > 0))
    if not len(i):
        return 0.0
    difference = []
    for frame in np.unique(np.linspace(0, len(diff) - 1, SAMPLES).astype(np.intp)):
        x_a, x_b = diff.a.positions[frame, a_points], diff.b.positions[frame, b_points]
        D_a = np.linalg.norm(x_a[i] - x_a[j], axis=-1) / tau_a[i, j]
        D_b = np.linalg.norm(x_b[i] - x_b[j], axis=-1) / tau_b[i, j]
        difference.append(np.abs(D_a - D_b))
    return float(np.percentile(difference, 99.5))


def _notes(step: int, diff: Diff) -> list[str]:
    """What a reader should know about the drawing."""
    thinned = f"long clip: player, matrices and thumbnails show one frame in {step}; figures are of all frames"
    same_legs = "A and B are drawn with legs of the same length"
    return [*([thinned] if step > 1 else []), *([same_legs] if diff.matching.legs else [])]


def in_base64(array: NDArray[Any], dtype: str) -> str:
    """An array as the text that the players read, its numbers of the given type."""
    return b64encode(np.ascontiguousarray(array, dtype).tobytes()).decode("ascii")
