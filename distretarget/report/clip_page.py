"""The report on a clip: an HTML page that plays a source and its result, or A and B of a diff, with their figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from distretarget.body.legs import Leg, leg_length, passing_regions
from distretarget.checks import check_kind
from distretarget.io.files import write_whole
from distretarget.measure.contacts import CONTACT_DISTANCE, FAR_ALONG, Candidates
from distretarget.measure.diff import Diff, turned_note
from distretarget.measure.feet import LOWEST
from distretarget.measure.figures import as_data
from distretarget.motion import Motion
from distretarget.numerics.time_series import spans_of
from distretarget.pipeline.result import RetargetResult
from distretarget.report.diff_document import About, DiffDocument, document
from distretarget.report.page import drawn_step, html_page, in_base64, packed, upright
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]
Joints = NDArray[np.intp]

SAMPLES = 64  # frames from which the range of the differences of D is estimated


def write_report(
    path: str | Path,
    compared: RetargetResult | Diff,
    *,
    source_name: str = "source",
    result_name: str = "result",
    overwrite: bool = False,
) -> None:
    """Write the report on a run or a diff: one HTML file that any browser opens without a network.

    `source_name` and `result_name` are what the report calls the two motions, A and B of a diff.

    Raises:
        FileError: the file exists and `overwrite` is false, or it cannot be written.
        SettingsError: `compared` has the wrong type.
    """
    check_kind("compared", compared, RetargetResult, Diff)
    about = About(a=source_name, b=result_name)
    if isinstance(compared, RetargetResult):
        html = run_page(compared, about)
    else:
        html = diff_page(compared, document(compared, about))
    write_whole(path, html, overwrite)


def run_page(result: RetargetResult, about: About) -> str:
    """The HTML of the report on a run: A is its source, B its result."""
    diff, copy = run_diff(result), result.tracks["rotation_copy"]
    about = replace(about, rotation_copy=copy, verdict=result.verdict, warnings=result.warnings)
    return diff_page(diff, document(diff, about))


def run_diff(result: RetargetResult) -> Diff:
    """The result of a run, B, measured against its source, A."""
    return Diff(
        a=result.source,
        b=result.motion,
        matching=result.matching,
        world=result.world,
        stress=result.written_stress,
        comparison=result.comparison,
        notes=turned_note(result.world),
        run_tracks=result.run_tracks,
    )


def diff_page(diff: Diff, document: DiffDocument) -> str:
    """The HTML of the report on a diff, with its document embedded unchanged."""
    source, result = ("source ", "result ") if document["figures"]["rotation_copy"] else ("", "")
    title = f"{result}{document['b']['file']} against {source}{document['a']['file']}"
    data = {"document": document, "drawing": diff_drawing(diff), "registry": as_data("A", "B")}
    return html_page("clip", title, data)


def diff_drawing(diff: Diff) -> dict[str, Any]:
    """The drawing data of a diff: y is up, the floor is at 0, and the unit of each motion is twice its leg length.

    Points are the joints that the matrices show, in the same order for A and B.
    """
    comparison, matching, contacts = diff.comparison, diff.matching, diff.comparison.contacts
    b_points, regions = contacts.candidates.points, matching.target.regions
    a_points = matching.drivers[b_points]
    step = drawn_step(len(diff), len(diff.a.skeleton) + len(diff.b.skeleton))
    legs = matching.legs or (None, None)
    resting = np.concatenate([comparison.feet.joints, comparison.supports.joints])
    rests = np.concatenate([comparison.feet.stance, comparison.supports.rest], axis=1)
    a_joints, b_joints = (a_points, matching.drivers[resting]), (b_points, resting)
    return {
        "step": step,  # one frame in this many is drawn
        "notes": _notes(step, diff),
        "near": CONTACT_DISTANCE,  # two regions touch if D of their nearest points is below this ...
        "limits": in_base64(_limits(contacts.candidates), "<u1"),  # (points, points), ... or less: this / 255 of it ...
        "far_along": FAR_ALONG,  # ... and the path between them has at least this many joints
        "regions": regions.of_joint[b_points].tolist(),  # of each point, -1 for none
        "passing": np.argwhere(np.triu(passing_regions(regions, legs[1]))).tolist(),  # never touch in these frames:
        "strides": in_base64(np.packbits(contacts.strides, bitorder="little"), "<u1"),  # (frames,), a bit each
        "facing": _facing(diff),
        "a": _drawing(diff.a, matching.source.skeleton, legs[0], a_joints, diff.up, step),
        "b": _drawing(diff.b, matching.target.skeleton, legs[1], b_joints, diff.up, step),
        "bone_errors": in_base64(_bone_errors(diff, step), "<u1"),
        "pelvis": [int(matching.drivers[matching.pelvis]), matching.pelvis],  # its joint in A and in B
        "rests": in_base64(np.packbits(rests, axis=1, bitorder="little"), "<u1"),  # (frames, bytes), a bit a joint
        "largest_difference": _largest_difference(diff, a_points, b_points),  # where the colours of the matrices end
        "contacts": _contacts(diff, b_points.tolist()),  # in the order of the document
    }


def _limits(candidates: Candidates) -> NDArray[np.float64]:
    """(points, points), the D below which two points touch, over `CONTACT_DISTANCE` / 255; 0 if they never do."""
    limits, points = np.zeros((len(candidates.points),) * 2), candidates.points
    u, v = np.searchsorted(points, candidates.u), np.searchsorted(points, candidates.v)
    limits[u, v] = limits[v, u] = np.round(255 * candidates.limits / CONTACT_DISTANCE)
    return limits


def _drawing(
    motion: Motion, body: Skeleton, legs: Sequence[Leg] | None, joints: tuple[Joints, Joints], up: Array, step: int
) -> dict[str, Any]:
    """The drawing data of one motion.

    `body` is its skeleton with rigid bones; `joints` are its points, and the joints that rest in some frame of A.
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


def _facing(diff: Diff) -> float:
    """The direction that B faces in its first frame, as an angle from z about y [rad]; 0 if it has no legs."""
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
    """The regions that touch in A: their nearest points in the worst frame, and when they touch in A and in B."""
    contacts, everything = diff.comparison.contacts, np.arange(len(diff.b.skeleton))
    frame, regions, _ = contacts.candidates.touching(diff.b, everything, contacts.strides)
    names = contacts.candidates.names
    return [
        {
            "pair": [points.index(touch.u), points.index(touch.v)],
            "a": spans_of(np.isin(np.arange(len(diff)), touch.frames)).tolist(),
            "b": spans_of(np.isin(np.arange(len(diff)), frame[regions == names.index(touch.name)])).tolist(),
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
