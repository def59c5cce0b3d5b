"""What a run reports: its line and its JSON."""

import json
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import clapping, lengthened, other_lengths, person, posed, swaying, tree_of

from distretarget import Options, retarget
from distretarget.ik.spg import Reason
from distretarget.measure.comparison import Reference
from distretarget.measure.metrics import METRICS, NOT_RUN, Track, clip_metrics, metrics_at
from distretarget.report.diff_document import metrics_json, metrics_line, summary_line

FRAMES = 40
SOLVER = {"iterations", "evaluations", "reason"}
OF_FRAMES = {metric.key for metric in METRICS if metric.of_frames}
OF_SOURCE = {metric.key for metric in METRICS if metric.of_source}


@cache
def run(objective="contact"):
    source = clapping(np.sin(np.linspace(0, np.pi, FRAMES)) ** 2)
    return retarget(source, lengthened(person(), {"Wrist": 1.5, "Knee": 0.9}), Options(objective=objective))


def result_with(**changes):
    return replace(run(), **changes)


def compared(result, motion):
    return Reference(result.source, result.matching, result.world.up_vector).compare(motion)


def without_skin(metrics):
    """The metrics that need no thickness of the bodies."""
    return {key: value for key, value in metrics.items() if not key.startswith("skin_")}


def refuse(constant):
    raise AssertionError(f"{constant} is no JSON")


def document(made):
    text = metrics_json(made)
    assert text.endswith("}\n")
    return json.loads(text, parse_constant=refuse)


@pytest.mark.parametrize("objective", ["contact", "paper"])
def test_every_metric_of_a_frame_is_there_for_every_frame(objective):
    frames = document(run(objective))["frames"]
    expected = SOLVER | OF_FRAMES | {f"{key}_copy" for key in OF_FRAMES} | {f"{key}_source" for key in OF_SOURCE}
    assert set(frames) == expected | ({"stress_solved_points"} if objective == "paper" else set())
    assert {len(values) for values in frames.values()} == {FRAMES}


def test_the_metrics_of_the_clip_stand_beside_those_of_the_rotation_copy():
    result = run()
    written = document(run())
    values = written["metrics"]
    assert list(values["result"]) == list(values["rotation_copy"]) == [metric.key for metric in METRICS]
    for side, motion, stress in (
        ("result", result.motion, result.written_stress),
        ("rotation_copy", result.rotation_copy, result.copy_stress),
    ):
        of_run = result.run_tracks if side == "result" else NOT_RUN
        tracks = {**compared(result, motion).tracks, "stress": Track(stress), **of_run}
        assert without_skin(values[side]) == without_skin(clip_metrics(tracks))
        assert values[side]["stress"] == stress.mean()
    assert values["source"] == clip_metrics(compared(result, result.motion).source_tracks)
    assert set(values["source"]) == OF_SOURCE
    assert values["rotation_copy"]["direction_error"] == pytest.approx(0.0, abs=1e-6)
    assert values["result"]["contact_error"] < 0.5 * values["rotation_copy"]["contact_error"]
    assert (written["format"], written["version"]) == ("distretarget-metrics", 1)
    assert written["frame_time"] == 0.02
    assert written["root_scale"] == pytest.approx(result.root_scale)


def test_frames_without_a_contact_have_no_contact_error():
    result = run()
    contacts = compared(result, result.motion).contacts.counts
    assert 0 < np.count_nonzero(contacts) < FRAMES
    frames = document(run())["frames"]
    for name in ("contact_error", "contact_error_copy"):
        np.testing.assert_array_equal([value is not None for value in frames[name]], contacts > 0)


def test_metrics_of_a_frame_are_those_of_the_result_and_of_the_copy():
    result = run()
    frames = document(run())["frames"]
    for motion, suffix in ((result.motion, ""), (result.rotation_copy, "_copy")):
        expected = compared(result, motion).tracks
        np.testing.assert_allclose(frames[f"direction_error{suffix}"], expected["direction_error"].values.mean(axis=1))
    assert frames["direction_error"] != frames["direction_error_copy"]
    assert frames["stress"] == result.written_stress.tolist()
    assert frames["stress_copy"] == result.copy_stress.tolist()


def test_frames_carry_what_the_solver_took_in_words():
    reasons = np.zeros(FRAMES, np.int64)
    reasons[3], reasons[5] = Reason.ITERATION_LIMIT, Reason.LINE_SEARCH_FAILED
    result = run()
    frames = document(result_with(effort=replace(result.effort, reasons=reasons)))["frames"]
    assert frames["iterations"] == result.effort.iterations.tolist()
    assert frames["reason"][2:6] == ["converged", "iteration limit", "converged", "line search failed"]


@pytest.mark.parametrize("frame", [0, 17, FRAMES - 1])
def test_the_line_names_the_frame_of_most_stress(frame):
    stress = np.full(FRAMES, 0.001)
    stress[frame] = 0.0625
    result = result_with()
    vars(result)["written_stress"] = stress
    line = metrics_line(result)
    assert line.startswith("rotation copy / result: ")
    assert line.endswith(f"most stress in frame {frame} (62.50)")
    assert "\n" not in line


def test_the_line_gives_each_metric_for_copy_and_result():
    made = run()
    baseline, result = (made.metrics[side] for side in ("rotation_copy", "result"))
    line = metrics_line(made)
    assert f"contact error {baseline['contact_error']:.4f} / {result['contact_error']:.4f}" in line
    assert f"foot skate [legs/s] {baseline['foot_skate']:.3f} / {result['foot_skate']:.3f}" in line
    assert f"direction error [°] 0.0 / {result['direction_error']:.1f}" in line
    for metric in metrics_at("line"):
        assert f"{metric.brief(baseline[metric.key])} / {metric.brief(result[metric.key])}" in line
    result = run("paper")
    assert f"stress of the solved points {1e3 * result.free_stress.mean():.2f};" in metrics_line(result)
    assert "solved points" not in metrics_line(run())


def test_the_line_of_a_run_has_its_time_and_its_verdict():
    made = run()
    assert summary_line(made, 1.234) == f"{FRAMES} frames in 1.23 s. {made.verdict}"
    assert document(made)["verdict"] == made.verdict
    assert list(run().warnings) == document(run())["warnings"] == []


def test_frames_that_did_not_converge_are_counted_and_the_first_is_named():
    reasons = np.zeros(FRAMES, np.int64)
    reasons[[7, 30]] = Reason.ITERATION_LIMIT
    reasons[9] = Reason.LINE_SEARCH_FAILED
    result = run()
    warnings = list(result_with(effort=replace(result.effort, reasons=reasons)).warnings)
    assert len(warnings) == 1
    assert warnings[0].startswith("frames not converged 3, limit 0; worst in frame 7; cause: the solver stopped after ")


@pytest.mark.parametrize(("off", "warned"), [(0.001, False), (0.05, True)])
def test_feet_that_miss_their_places_give_a_warning(off, warned):
    result = run()
    places = np.array(result.supports.places)
    places[12:20] += [0, off, 0]
    warnings = list(result_with(supports=replace(result.supports, places=places)).warnings)
    assert len(warnings) == warned
    for line in warnings:
        assert line.startswith(f"resting joints do not reach their places in 8 of {FRAMES} frames (first: frame 12): ")
        assert re.search(r"most: '?\w+'? in frame \d+, \d+\.\d % of a leg away(, because the leg is straight)?$", line)


@pytest.mark.parametrize("bend", [0.0, 0.6])
def test_the_warning_says_whether_a_foot_is_out_of_reach(bend):
    """Straight legs cannot get farther down; bent ones miss their places for another reason."""
    turns = {f"{side}{part}": [k * bend, 0, 0] for side in ("Left", "Right") for part, k in (("Hip", -1), ("Knee", 2))}
    source = posed(person(), turns, np.tile([0.0, 0.9, 0.0], (20, 1)))
    made = retarget(source, person())
    supports = replace(made.supports, places=made.supports.places - np.array([0, 0.05, 0]))
    (line,) = (line for line in replace(made, supports=supports).warnings if "reach their places" in line)
    assert line.endswith("because the leg is straight") == (bend == 0.0)


def test_an_ankle_that_stands_for_its_toe_is_named_once():
    supports = run().supports
    ankles = np.repeat(supports.joints[::2], 2)
    places = supports.places + np.array([0, 0.5, 0])
    (line,) = result_with(supports=replace(supports, joints=ankles, places=places)).warnings
    named = re.search(r"\): (.*); most", line)[1].split(", ")
    assert len(named) == len(set(named)) == len(np.unique(ankles))
    result = run()
    places, weights = np.array(result.supports.places) + 1.0, np.zeros_like(result.supports.weights)
    assert list(result_with(supports=replace(result.supports, places=places, weights=weights)).warnings) == []


@pytest.mark.parametrize("frames", [1, 2])
def test_the_shortest_clips_have_a_line_and_json(frames):
    source = swaying(person(), frames=frames)
    made = retarget(source, other_lengths(person()))
    assert summary_line(made, 0.1).startswith("1 frame in 0.10 s. " if frames == 1 else "2 frames in 0.10 s. ")
    assert metrics_line(made)
    assert {len(values) for values in document(made)["frames"].values()} == {frames}
    list(made.warnings)


def test_a_chain_without_legs_or_contacts_has_a_line_and_json():
    offsets = np.outer([0.0, 1, 1], [0, 1.0, 0])
    chain = tree_of(offsets)
    source = swaying(chain)
    made = retarget(source, chain.with_offsets(2 * offsets))
    assert (
        "contact error - / -, skin inside [% height] - / -, direction error [°] 0.0 / 0.0, foot skate [legs/s] - / -"
        in metrics_line(made)
    )
    assert set(document(made)["frames"]["contact_error"]) == {None}
    assert list(made.warnings) == []
    assert made.verdict == "There are no self-contacts to keep; no foot is planted in the source."


def test_a_still_clip_is_as_smooth_as_its_copy():
    source = clapping(np.zeros(10))
    made = retarget(source, person())
    assert "jerk [sizes/s³] 0.0 / 0.0" in metrics_line(made)
    assert "nan" not in metrics_line(made) + summary_line(made, 0.1)
