"""The document of a diff: its numbers, what is null in it, its schema, its CSV."""

import csv
import io
import json
from dataclasses import replace
from functools import cache
from importlib.resources import files

import jsonschema
import numpy as np
import pytest
from bodies import SAMPLES, clapping, lengthened, person, posed, swaying, with_bone

from distretarget import read_bvh, retarget
from distretarget.measure.diff import Diff, diff
from distretarget.measure.metrics import compare
from distretarget.report.document import PAIRS, STILL, About, csv_text, document, json_text

PERSON = person()
ABOUT = About("a.bvh", "b.bvh", "distretarget diff a.bvh b.bvh", "1.2.3")
ERRORS = ("stress", "distance_error", "contact_error", "direction_error", "direction_error_p99", "bone_error", "turn")
COLUMNS = [
    "frame",
    "time",
    "stress",
    "distance_error",
    "contact_error",
    "contacts",
    "direction_error",
    "bone_error",
    "slide_a",
    "slide_b",
    "stance",
    "jerk_a",
    "jerk_b",
]


def first(motion, frames):
    return replace(motion, translations=motion.translations[:frames], rotations=motion.rotations[:frames])


def flying(seed, frames=20):
    """A person whose feet never rest: both swing fast."""
    return swaying(PERSON, frames, angle=1.5, seed=seed)


def standing(speed, frames=20):
    """A person with the feet apart, carried along the floor at a speed [m/s]."""
    apart = {"LeftHip": np.array([0.0, 0.0, 0.5]), "RightHip": np.array([0.0, 0.0, -0.5])}
    return posed(PERSON, apart, np.outer(np.arange(frames), [0.02 * speed, 0, 0]) + np.array([0, 0.9, 0]))


CLIPS = {
    "clap": lambda: (clapping(np.sin(np.linspace(0, 3, 20)) ** 2), clapping(np.sin(np.linspace(0, 2, 20)) ** 2)),
    "sway": lambda: (flying(1), flying(2)),
    "slide": lambda: (standing(0.02), standing(0.05)),
    "still against moving": lambda: (standing(0.0), standing(0.05)),
    "one frame": lambda: (first(flying(1), 1), first(flying(2), 1)),
    "three frames": lambda: (first(flying(1), 3), first(flying(2), 3)),
    "a tail": lambda: (flying(1), swaying(with_bone(PERSON, "Tail", "Hips"))),
    "another body": lambda: (flying(1), swaying(lengthened(PERSON, {"Knee": 0.7}))),
    "frame rates": lambda: (replace(flying(1), frame_time_text="0.01"), flying(2)),
    "a frame time beyond all": lambda: (replace(flying(1), frame_time_text="1e-200"),) * 2,
    "samples": lambda: (read_bvh(SAMPLES / "walk.bvh"), read_bvh(SAMPLES / "wave.bvh")),
}


@cache
def made(name):
    a, b = CLIPS[name]()
    with np.errstate(all="ignore"):
        return document(diff(a, b), ABOUT)


@cache
def validator():
    schema = json.loads(files("distretarget.report").joinpath("diff.schema.json").read_text("utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def column(name, of):
    return [frame[name] for frame in of["frames"]]


def refuse(constant):
    raise AssertionError(f"{constant} is no JSON")


@pytest.mark.parametrize("name", CLIPS)
def test_a_document_follows_the_schema_and_says_the_same_as_json(name):
    found = made(name)
    validator().validate(found)
    assert json.loads(json_text(found), parse_constant=refuse) == found
    assert len(found["frames"]) == found["frame_count"]
    assert column("frame", found) == list(range(found["frame_count"]))
    assert len(found["pairs"]) <= PAIRS


@pytest.mark.parametrize("name", CLIPS)
def test_csv_has_the_numbers_of_the_frames(name):
    rows = list(csv.reader(io.StringIO(csv_text(made(name)))))
    assert rows[0] == COLUMNS
    read = [{key: float(cell) if cell else None for key, cell in zip(COLUMNS, row, strict=True)} for row in rows[1:]]
    assert read == made(name)["frames"]


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("version",), 2),
        (("summary", "stress"), None),
        (("summary", "stress"), "0"),
        (("summary", "contact_error"), -1.0),
        (("summary", "more"), 1.0),
        (("limits",), {}),
        (("limits",), [{"figure": "beauty", "limit": 1, "value": None, "over": False}]),
        (("frames",), []),
        (("frames", 0, "frame"), 0.5),
        (("pairs", 0, "joints_a"), ["one"]),
        (("rotation_copy",), {}),
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
    assert not validator().is_valid(broken)


@pytest.mark.parametrize("key", ["a", "summary", "limits", "rotation_copy", "frames", "pairs"])
def test_the_schema_wants_everything(key):
    assert not validator().is_valid({name: value for name, value in made("clap").items() if name != key})


@pytest.mark.parametrize("sample", ["clap", "walk", "squat"])
def test_a_motion_against_itself_is_all_zeros(sample):
    motion = read_bvh(SAMPLES / f"{sample}.bvh")
    found = document(diff(motion, motion), ABOUT)
    summary = found["summary"]
    assert {name: summary[name] for name in ERRORS} == dict.fromkeys(ERRORS, 0)
    assert summary["jerk"] == 1
    assert summary["slide"] == (1 if summary["slide_a"] > STILL else None)
    for name in ("slide", "foot_height", "jerk"):
        assert summary[f"{name}_a"] == summary[f"{name}_b"]
    for name in ("stress", "distance_error", "contact_error", "direction_error", "bone_error"):
        assert set(column(name, found)) <= {0, None}
    for name in ("slide", "jerk"):
        assert column(f"{name}_a", found) == column(f"{name}_b", found)
    assert {pair["error"] for pair in found["pairs"]} == {0}


def test_the_summary_is_that_of_the_frames():
    found = made("clap")
    summary, mean = (
        found["summary"],
        lambda name: np.mean([value for value in column(name, found) if value is not None]),
    )
    for name in ("stress", "distance_error", "direction_error", "jerk_a", "jerk_b"):
        assert summary[name] == pytest.approx(mean(name))
    contacts = column("contacts", found)
    pooled = sum(error * count for error, count in zip(column("contact_error", found), contacts, strict=True) if count)
    assert summary["contact_error"] == pytest.approx(pooled / sum(contacts))
    assert summary["contact_frames"] == np.count_nonzero(contacts) > 0
    assert summary["bone_error"] == max(column("bone_error", found))


def test_the_worst_frames_have_the_largest_figures():
    found = made("clap")
    for name, frame in found["worst"].items():
        assert column(name, found)[frame] == max(value for value in column(name, found) if value is not None)


def test_limits_say_what_is_over():
    keys = ("stress", "distance_error", "contact_error", "direction_error", "bone_error", "turn")
    names = {key.removesuffix("_error"): key for key in keys}
    limits = [(name, limit) for name in (*names, "slide", "foot", "jerk") for limit in (0.0, 1e9)]
    found = document(diff(*CLIPS["slide"]()), replace(ABOUT, limits=tuple(limits)))
    validator().validate(found)
    assert [(one["figure"], one["limit"]) for one in found["limits"]] == limits
    values = {one["figure"]: one["value"] for one in found["limits"]}
    summary = found["summary"]
    assert {name: values[name] for name in names} == {name: summary[key] for name, key in names.items()}
    assert values["contact"] is None
    assert (values["slide"], values["jerk"]) == (summary["slide"], summary["jerk"])
    assert values["foot"] == pytest.approx(abs(summary["foot_height_b"] - summary["foot_height_a"]))
    over = {(one["figure"], one["limit"]) for one in found["limits"] if one["over"]}
    assert over == {(name, 0.0) for name, value in values.items() if value}
    assert made("slide")["limits"] == []


def test_what_is_not_there_is_null():
    found = made("sway")
    assert (found["summary"]["contact_error"] is None) == (found["summary"]["contact_frames"] == 0)
    slow = made("slide")
    assert slow["summary"]["contact_error"] is slow["worst"]["contact_error"] is None
    assert set(column("contact_error", slow)) == {None}
    assert set(column("stance", slow)) == {4}
    assert slow["summary"]["slide"] == pytest.approx(2.5)
    assert made("still against moving")["summary"]["slide_a"] == 0
    assert made("samples")["summary"]["slide_a"] > STILL
    assert made("still against moving")["summary"]["slide"] is None


def test_without_stance_there_is_no_slide():
    falling = posed(PERSON, {}, np.outer(np.arange(20), [0, -1.0, 0]))
    found = document(diff(falling, falling), ABOUT)
    assert set(column("slide_a", found)) == set(column("slide_b", found)) == {None}
    assert {found["summary"][key] for key in ("slide_a", "slide_b", "slide", "foot_height_a")} == {None}
    assert found["worst"]["slide_b"] is None


def test_jerk_needs_four_frames():
    for name in ("one frame", "three frames"):
        found = made(name)
        assert {found["summary"][key] for key in ("jerk_a", "jerk_b", "jerk")} == {None}
        assert set(column("jerk_a", found)) == {None}
    assert made("one frame")["summary"]["turn"] is None
    assert [value is None for value in column("jerk_b", made("sway"))] == [False] * 17 + [True] * 3


def test_names_notes_and_leftover_joints():
    found = made("a tail")
    assert (found["unmatched_a"], found["unmatched_b"]) == ([], ["Tail"])
    assert (found["a"]["joints"], found["b"]["joints"]) == (22, 23)
    assert (found["a"]["file"], found["b"]["file"]) == ("a.bvh", "b.bvh")
    assert found["program"] == {"version": "1.2.3", "command": "distretarget diff a.bvh b.bvh"}
    assert found["notes"] == []
    assert made("frame rates")["notes"]


def test_pairs_have_the_names_of_both_bodies():
    pair = made("clap")["pairs"][0]
    assert pair["contact_frames"] > 0
    assert pair["joints_a"] == pair["joints_b"]
    assert set(pair["joints_b"]) <= set(PERSON.keys)
    errors = [pair["error"] for pair in made("slide")["pairs"]]
    assert errors == sorted(errors, reverse=True)


def test_the_rotation_copy_is_the_third_figure():
    run = retarget(first(CLIPS["clap"]()[0], 12), lengthened(PERSON, {"Elbow": 1.3}))
    up = run.world.up_vector
    reached, copied = (compare(run.source, motion, run.matching, up) for motion in (run.motion, run.copy))
    result = Diff(run.source, run.motion, run.matching, up, run.written_stress, reached, ())
    found = document(result, replace(ABOUT, copy=copied, copy_stress=run.copy_stress))
    validator().validate(found)
    assert found["rotation_copy"].keys() == found["summary"].keys()
    assert found["rotation_copy"]["contact_error"] > found["summary"]["contact_error"]
    assert found["rotation_copy"]["jerk_a"] == found["summary"]["jerk_a"]
    again = document(diff(run.source, run.motion), ABOUT)
    assert again["rotation_copy"] is None
    assert again["summary"]["contact_error"] == pytest.approx(found["summary"]["contact_error"])
