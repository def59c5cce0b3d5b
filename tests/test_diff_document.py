"""The numbers of a diff as one document: its schema, its values, and its tables as CSV."""

import csv
import io
import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import APART, PERSON, clapping, lengthened, posed, sample, standing, swaying, with_bone
from schemas import schema, validator

from distretarget import retarget
from distretarget.measure.diff import diff
from distretarget.measure.metrics import BY_KEY, METRICS
from distretarget.report.clip_page import run_diff
from distretarget.report.diff_document import About, csv_lines, csv_text, document, json_text
from distretarget.report.page import VERSION

ABOUT = About(a="a.bvh", b="b.bvh", command="distretarget diff a.bvh b.bvh")
OF_RUN = ["turned", "arm_deviation", "shaking", "pop", "not_converged"]
OF_SKIN = ["skin_depth", "part_depth", "skin_frames"]  # of bodies whose thickness is known
ERRORS = [metric.key for metric in METRICS if metric.judged == "value" and metric.key not in OF_RUN + OF_SKIN]
NONE = {"support_skate", "support_height", "palm_turn"}  # where only feet rest, and there are no fingers
OF_SOURCE = [metric.key for metric in METRICS if metric.of_source]
COLUMNS = [
    *("frame", "time", "contacts", "stance", "supports"),
    *(
        "contact_error",
        *("skin_depth", "part_depth", "skin_frames", "skin_gap", "touch_missed", "touch_place"),
        "direction_error",
        "foot_skate_source",
        "foot_skate",
        "foot_height",
        "floor",
    ),
    *("hips_height", "trunk_tilt", "head_tilt", "palm_turn", "sole_tilt", "heading", "splay"),
    *("hips_acceleration_source", "hips_acceleration"),
    *("support_skate_source", "support_skate", "support_height"),
    *("turned", "arm_deviation", "shaking"),
    *("pop", "not_converged", "stress", "jerk_source", "jerk", "turn"),
]


def flying(seed, frames=20):
    """A person whose feet never rest: both swing fast."""
    return swaying(PERSON, frames, angle=1.5, seed=seed)


def sliding(speed, frames=20):
    """A person with the feet apart, carried along the floor at a speed [m/s]."""
    return standing(APART, frames, np.outer(np.arange(frames), [0.02 * speed, 0, 0]), 0.9)


CLIPS = {
    "clap": lambda: (clapping(np.sin(np.linspace(0, 3, 20)) ** 2), clapping(np.sin(np.linspace(0, 2, 20)) ** 2)),
    "sway": lambda: (flying(1), flying(2)),
    "foot_skate": lambda: (sliding(0.02), sliding(0.05)),
    "still against moving": lambda: (sliding(0.0), sliding(0.05)),
    "one frame": lambda: (flying(1)[:1], flying(2)[:1]),
    "three frames": lambda: (flying(1)[:3], flying(2)[:3]),
    "a tail": lambda: (flying(1), swaying(with_bone(PERSON, "Tail", "Hips"))),
    "another body": lambda: (flying(1), swaying(lengthened(PERSON, {"Knee": 0.7}))),
    "frame rates": lambda: (replace(flying(1), frame_time_text="0.01"), flying(2)),
    "the shortest frame time": lambda: (replace(flying(1), frame_time_text="1e-5"),) * 2,
    "samples": lambda: (sample("walk"), sample("wave")),
}


@cache
def made(name):
    a, b = CLIPS[name]()
    with np.errstate(all="ignore"):
        return document(diff(a, b), ABOUT)


def column(name, of):
    return [frame[name] for frame in of["frames"]]


def refuse(constant):
    raise AssertionError(f"{constant} is no JSON")


@pytest.mark.parametrize("name", CLIPS)
def test_a_document_follows_the_schema_and_says_the_same_as_json(name):
    found = made(name)
    validator("report/diff").validate(found)
    assert json.loads(json_text(found), parse_constant=refuse) == found
    assert len(found["frames"]) == found["frame_count"]
    assert column("frame", found) == list(range(found["frame_count"]))


def test_the_type_has_the_keys_of_the_schema():
    assert made("clap").keys() == schema("report/diff")["properties"].keys()


@pytest.mark.parametrize("name", CLIPS)
def test_csv_has_the_numbers_of_the_frames(name):
    rows = list(csv.reader(io.StringIO(csv_text(made(name)["frames"]))))
    assert rows[0] == COLUMNS
    read = [{key: float(cell) if cell else None for key, cell in zip(COLUMNS, row, strict=True)} for row in rows[1:]]
    assert read == made(name)["frames"]


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("version",), 2),
        (("metrics", "result", "stress"), None),
        (("metrics", "result", "stress"), "0"),
        (("metrics", "result", "contact_error"), -1.0),
        (("metrics", "result", "more"), 1.0),
        (("limits",), {}),
        (("limits",), [{"metric": "beauty", "limit": 1, "value": None, "over": False}]),
        (("frames",), []),
        (("frames", 0, "frame"), 0.5),
        (("contacts", 0, "joints_a"), ["one"]),
        (("metrics", "rotation_copy"), {}),
        (("metrics", "source", "stress"), 0.0),
        (("worst", "stress"), "first"),
        (("notes",), "none"),
        (("frame_time",), 0),
    ],
)
def test_the_schema_refuses_what_is_no_document(place, value):
    broken = json.loads(json_text(made("clap")))
    inside = broken
    for key in place[:-1]:
        inside = inside[key]
    inside[place[-1]] = value
    assert not validator("report/diff").is_valid(broken)


@pytest.mark.parametrize("key", ["a", "metrics", "limits", "worst", "frames", "contacts"])
def test_the_schema_wants_everything(key):
    assert not validator("report/diff").is_valid({name: value for name, value in made("clap").items() if name != key})


@pytest.mark.parametrize("clip", ["clap", "hands_on_hips"])
def test_a_motion_against_itself_has_no_errors(clip):
    motion = sample(clip)
    found = document(diff(motion, motion), ABOUT)
    source, result = found["metrics"]["source"], found["metrics"]["result"]
    none = NONE | ({"touch_place"} if clip == "clap" else set())  # places are on trunk, legs and head
    assert {result[key] for key in none} == {None}
    errors = {key: result[key] for key in ERRORS if key not in none}
    assert {*errors.values()} == {0}
    assert source == {key: result[key] for key in OF_SOURCE}
    assert result.keys() == {*ERRORS, *OF_SOURCE, *OF_RUN, *OF_SKIN}
    for key in ERRORS:
        if BY_KEY[key].of_frames:
            assert set(column(key, found)) <= {0, None}
    for key in OF_SOURCE:
        assert column(f"{key}_source", found) == column(key, found)
    assert {pair["error"] for pair in found["contacts"]} <= {0}


def test_the_metrics_of_the_clip_are_those_of_the_frames():
    found = made("clap")
    source, result = found["metrics"]["source"], found["metrics"]["result"]

    def mean(key):
        return pytest.approx(np.mean([value for value in column(key, found) if value is not None]))

    for key in ("stress", "direction_error", "jerk"):
        assert result[key] == mean(key)
    assert source["jerk"] == mean("jerk_source")
    assert result["contact_error"] == mean("contact_error")
    assert found["contact_frames"] == np.count_nonzero(column("contacts", found)) > 0
    assert result["turn"] == max(value for value in column("turn", found) if value is not None)


def test_the_worst_frames_have_the_largest_metrics():
    found = made("clap")
    for name, frame in found["worst"].items():
        if frame is None:
            assert set(column(name, found)) == {None}
            continue
        assert column(name, found)[frame] == max(value for value in column(name, found) if value is not None)


def test_limits_say_what_is_over():
    limits = [(key, limit) for key in BY_KEY for limit in (0.0, 1e9)]
    found = document(diff(*CLIPS["foot_skate"]()), replace(ABOUT, limits=tuple(limits)))
    validator("report/diff").validate(found)
    assert [(one["metric"], one["limit"]) for one in found["limits"]] == limits
    values = {one["metric"]: one["value"] for one in found["limits"]}
    source, result = found["metrics"]["source"], found["metrics"]["result"]
    assert {key: values[key] for key in ERRORS} == {key: result[key] for key in ERRORS}
    assert values["contact_error"] is None
    assert values["foot_skate"] == pytest.approx(2.5)
    assert values["jerk"] == pytest.approx(result["jerk"] / source["jerk"])
    over = {(one["metric"], one["limit"]) for one in found["limits"] if one["over"]}
    assert over == {(key, 0.0) for key, value in values.items() if value}
    assert made("foot_skate")["limits"] == []


def test_what_is_not_there_is_null():
    found = made("sway")
    assert (found["metrics"]["result"]["contact_error"] is None) == (found["contact_frames"] == 0)
    slow = made("foot_skate")
    assert slow["metrics"]["result"]["contact_error"] is slow["worst"]["contact_error"] is None
    assert set(column("contact_error", slow)) == {None}
    assert set(column("stance", slow)) == {4}
    assert slow["metrics"]["rotation_copy"] is None
    assert made("still against moving")["metrics"]["source"]["foot_skate"] == 0


def test_without_stance_there_is_no_foot_skate():
    falling = posed(PERSON, {}, np.outer(np.arange(20), [0, -1.0, 0]))
    found = document(diff(falling, falling), ABOUT)
    assert set(column("foot_skate_source", found)) == {None}
    assert found["metrics"]["source"]["foot_skate"] is None
    for key in ("foot_skate", "foot_height", "hips_height"):
        assert set(column(key, found)) == {None}
        assert found["metrics"]["result"][key] is None
    assert found["worst"]["foot_skate"] is None


def test_jerk_needs_four_frames_and_turn_two():
    for name in ("one frame", "three frames"):
        found = made(name)
        assert found["metrics"]["source"]["jerk"] is found["metrics"]["result"]["jerk"] is None
        assert set(column("jerk_source", found)) == {None}
    assert made("one frame")["metrics"]["result"]["turn"] is None
    assert [value is None for value in column("jerk", made("sway"))] == [False] * 17 + [True] * 3
    assert [value is None for value in column("turn", made("sway"))] == [False] * 19 + [True]


def test_names_notes_and_leftover_joints():
    found = made("a tail")
    assert (found["unmatched_a"], found["unmatched_b"]) == ([], ["Tail"])
    assert (found["a"]["joints"], found["b"]["joints"]) == (22, 23)
    assert (found["a"]["file"], found["b"]["file"]) == ("a.bvh", "b.bvh")
    assert found["program"] == {"version": VERSION, "command": "distretarget diff a.bvh b.bvh"}
    assert found["notes"] == []
    assert made("frame rates")["notes"]


def test_contacts_name_regions_and_the_joints_of_both_bodies_hands_first():
    contact = made("clap")["contacts"][0]
    assert contact["regions"] == "left hand - right hand"
    assert contact["frames"] > 0
    assert contact["joints_a"] == contact["joints_b"]
    assert set(contact["joints_b"]) <= set(PERSON.keys)
    assert made("foot_skate")["contacts"] == []


def test_snaps_and_unsolved_frames_are_known_of_a_run_only():
    run = retarget(CLIPS["clap"]()[0][:6], PERSON)
    of_run, of_files = document(run_diff(run), ABOUT), document(diff(run.source, run.motion), ABOUT)
    for key in OF_RUN:
        assert of_run["metrics"]["result"][key] == pytest.approx(0.0, abs=1e-4)
        assert of_files["metrics"]["result"][key] is None


def test_the_rotation_copy_stands_beside_the_result():
    run = retarget(CLIPS["clap"]()[0][:12], lengthened(PERSON, {"Elbow": 1.3}))
    found = document(run_diff(run), replace(ABOUT, rotation_copy=run.tracks["rotation_copy"]))
    validator("report/diff").validate(found)
    metrics = found["metrics"]
    assert metrics["rotation_copy"].keys() == metrics["result"].keys()
    assert metrics["rotation_copy"]["contact_error"] > metrics["result"]["contact_error"]
    again = document(diff(run.source, run.motion), ABOUT)["metrics"]
    assert again["rotation_copy"] is None
    assert again["result"]["contact_error"] == pytest.approx(metrics["result"]["contact_error"])


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1"])
def test_no_text_is_a_formula(text):
    rows = list(csv.reader(csv_lines([text, "b"], [{text: text, "b": -1.5}])))
    assert rows == [[f"'{text}", "b"], [f"'{text}", "-1.5"]]


def test_no_text_ends_its_row():
    assert [*csv.reader(csv_lines(["a", "b"], [{"a": "x\r\ny", "b": "\r=1"}]))][1:] == [["x \ny", " =1"]]
    assert [*csv_lines(["a", "b"], [{"a": None}, {"b": 'x, "y"'}])] == ["a,b\n", ",\n", ',"x, ""y"""\n']
    assert csv_text([{"a": 1}, {"a": 2}]) == "a\n1\n2\n"
