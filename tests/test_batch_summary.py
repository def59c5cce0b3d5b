"""The summary of a run, and the spread of the alignments of its clips of one rig."""

import base64
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from bodies import PERSON, matched, posed
from input_files import named_target
from program import last_records
from scipy.spatial.transform import Rotation

from distretarget import convert_folder, write_bvh
from distretarget.batch.plan import PlannedClip
from distretarget.batch.results import Database, new_record
from distretarget.batch.summary import SCALE, SPREAD_ROLES, Tally, alignment_text, largest_spread, spread_warnings


def record(name):
    return new_record(PlannedClip(Path(name), named_target("{}", "hero.json"), (name,), 1), {})


def done(name, contact):
    values = {"contact_error": contact, "direction_error": 0.0, "hips_height": 0.0, "stress": 1 - contact}
    metrics = values | {f"{name}_copy": value for name, value in values.items()}
    outcome = {"status": "done", "output_hash": "out", "frames": 100, "metrics": metrics}
    return record(name) | outcome


def failed(name, error):
    return record(name) | {"error": error}


def summary(records, clips=None):
    tally = Tally(clips=len(records) if clips is None else clips, workers=2, seconds=2.0)
    for record in records:
        tally.add(record)
    return tally.lines


def test_the_summary_counts_clips():
    lines = summary(
        [None, *(done(f"{number}.bvh", number / 10) for number in range(5)), failed("x.bvh", "x.bvh:3: no")]
    )
    assert lines == [
        "7 clips: 5 converted, 1 done before, 1 failed",
        "500 frames in 2.0 s, 250 frames/s with 2 jobs",
        "failed:",
        "  x.bvh:3: no",
    ]


def flagged(name, **metrics):
    one = done(name, 0.0)
    return one | {"metrics": one["metrics"] | metrics, "warnings": ["a warning"]}


def test_clips_to_look_at_are_listed_with_the_reasons_worst_first():
    """By how many times the worst limit of each is exceeded: 2.2 % of height, 1.5 % of depth; reasons, too."""
    records = [
        flagged("tilted.bvh", foot_height=7.5),
        flagged("inside.bvh", foot_height=7.5, skin_depth=6.0),
        done("good.bvh", 0.0),
        flagged("away.bvh"),
    ]
    assert summary(records)[2:] == [
        "look at 3 of 4 clips, worst first; metrics.csv has the frames:",
        "  inside.bvh: hands or forearms sink into the body (skin inside 6 % of height); "
        "feet float over the floor or sink into it (foot height 7.5 % of leg length)",
        "  tilted.bvh: feet float over the floor or sink into it (foot height 7.5 % of leg length)",
        "  away.bvh: a warning",
    ]


def test_of_many_clips_to_look_at_the_worst_are_listed():
    lines = summary([flagged(f"{angle}.bvh", foot_height=float(angle)) for angle in range(6, 40)])
    assert lines[2].startswith("look at 34 of 34 clips, worst first, the worst 10 of which are here; ")
    assert [line.split(":")[0] for line in lines[3:]] == [f"  {angle}.bvh" for angle in range(39, 29, -1)]


def test_failures_are_named_and_counted_as_clips_that_are_left():
    lines = summary([failed(f"{number}.bvh", "no") for number in range(50)])
    assert lines[-1] == "  and 30 more; metrics.csv has them all"
    assert len(lines) == 23
    assert summary([failed("in/x.bvh", "hero.json: does not match")])[-1] == "  in/x.bvh: hero.json: does not match"
    assert summary([done("a.bvh", 0.1)], 5)[0] == "5 clips: 1 converted, 0 done before, 0 failed, 4 left"
    assert summary([done("a.bvh", 0.1)])[0] == "1 clip: 1 converted, 0 done before, 0 failed"


def clip(head=0.0, scale=1.0):
    """A person, larger or smaller, who stands and nods by an angle [degrees]."""
    turns = {"Head": np.radians([head, 0.0, 0.0])}
    return posed(PERSON.with_lengths(scale * PERSON.lengths), turns, np.tile([0.0, 0.9 * scale, 0.0], (10, 1)))


def alignment(angle):
    """The rotations of an alignment as text, with a head turned by an angle [degrees]."""
    rotations = np.zeros((len(SPREAD_ROLES), 4))
    rotations[SPREAD_ROLES.index("head")] = SCALE * Rotation.from_euler("X", angle, degrees=True).as_quat()
    return base64.b64encode(np.round(rotations).astype("<i2").tobytes()).decode()


def aligned(name, text, target="hero.json"):
    return {"output": name, "alignment": text, "target": target, "target_hash": target, "options": {}}


def test_the_largest_spread_is_between_the_two_clips_that_differ_most():
    angles = np.zeros((4, 3))
    angles[:, 1] = [0.0, -20.0, 5.0, 30.0]
    rotations = Rotation.from_euler("X", angles.reshape(-1, 1), degrees=True).as_quat().reshape(4, 3, 4)
    rotations[2] *= -1.0  # the same rotations
    rotations[1, 2] = 0.0  # unknown
    angle, joint, *clips = largest_spread(rotations)
    assert angle == pytest.approx(50.0)
    assert (joint, {*clips}) == (1, {1, 3})


def test_clips_of_a_rig_that_stands_are_aligned_alike():
    texts = [alignment_text(matched(clip(*each), PERSON)) for each in ((), (50.0,), (0.0, 1.3))]
    assert len({*texts}) == 1
    assert not [*spread_warnings(aligned(f"{k}.bvh", text) for k, text in enumerate(texts))]
    turned = Rotation.from_euler("X", 90, degrees=True).apply(np.array(PERSON.offsets))
    assert alignment_text(matched(PERSON.with_offsets(turned), PERSON)).split(":")[0] != texts[0].split(":")[0]


def test_clips_that_are_not_are_named():
    records = [aligned(f"{k}.bvh", f"rig:{alignment(angle)}") for k, angle in enumerate((0.0, 3.0, 30.0))]
    (line,) = spread_warnings(records)
    assert line.startswith("warning: 3 clips of one rig are aligned with hero.json in ways that differ by up to 30 deg")
    assert "(head, 2.bvh and 0.bvh)" in line
    assert not [*spread_warnings(records[:2])]


@pytest.mark.parametrize("text", ["", "rig", "rig:", "rig:AAAA", "rig:\u00e9", "rig:{}"])
def test_what_is_no_alignment_is_passed_over(text):
    assert not [*spread_warnings([aligned("a.bvh", text), aligned("b.bvh", f"rig:{alignment(0.0)}")])]


def test_clips_of_other_rigs_or_targets_may_be_aligned_otherwise():
    records = [aligned(f"{k}.bvh", f"rig {k}:{alignment(30.0 * k)}") for k in range(3)]
    assert not [*spread_warnings(records)]
    records = [aligned(f"{k}.bvh", f"rig:{alignment(30.0 * k)}", f"{k}.json") for k in range(3)]
    assert not [*spread_warnings(records)]


def test_a_batch_that_goes_on_warns_of_clips_that_are_done(tmp_path):
    (tmp_path / "clips").mkdir()
    for name in "ab":
        write_bvh(tmp_path / "clips" / f"{name}.bvh", clip())
    write_bvh(tmp_path / "hero.bvh", clip())
    batch = tmp_path / "clips", tmp_path / "hero.bvh", tmp_path / "out"
    assert not convert_folder(*batch, jobs=1).alignments
    first = last_records(tmp_path / "out")["a.bvh"]
    rig, text = first["alignment"].split(":")
    rotations = np.frombuffer(base64.b64decode(text), "<i2").reshape(-1, 4).copy()
    rotations[SPREAD_ROLES.index("head")] = np.round(SCALE * np.sqrt(0.5)), 0, 0, np.round(SCALE * np.sqrt(0.5))
    other = base64.b64encode(rotations.tobytes()).decode()
    with closing(Database(tmp_path / "out")) as database:
        database.add(first | {"alignment": f"{rig}:{other}"})
    again = convert_folder(*batch, jobs=1)
    assert again.skipped == 2
    (line,) = again.alignments
    assert "differ by up to 90 degrees (head," in line
    assert line in again.lines
