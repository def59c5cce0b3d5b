"""The summary of a run."""

from pathlib import Path

from input_files import named_target

from distretarget.batch.plan import PlannedClip
from distretarget.batch.record import new_record
from distretarget.batch.summary import Tally


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
    """By how many times the worst limit of each is exceeded: 5 degrees of pitch, 1.5 % of depth; reasons, too."""
    records = [
        flagged("tilted.bvh", foot_pitch=7.5),
        flagged("inside.bvh", foot_pitch=7.5, skin_depth=6.0),
        done("good.bvh", 0.0),
        flagged("away.bvh"),
    ]
    assert summary(records)[2:] == [
        "look at 3 of 4 clips, worst first; metrics.csv has the frames:",
        "  inside.bvh: hands or forearms sink into the body (skin inside 6 % of height); "
        "feet are visibly tilted (foot pitch 7.5 degrees)",
        "  tilted.bvh: feet are visibly tilted (foot pitch 7.5 degrees)",
        "  away.bvh: a warning",
    ]


def test_of_many_clips_to_look_at_the_worst_are_listed():
    lines = summary([flagged(f"{angle}.bvh", foot_pitch=float(angle)) for angle in range(6, 40)])
    assert lines[2].startswith("look at 34 of 34 clips, worst first, the worst 10 of which are here; ")
    assert [line.split(":")[0] for line in lines[3:]] == [f"  {angle}.bvh" for angle in range(39, 29, -1)]


def test_a_failure_names_its_clip():
    assert summary([failed("in/x.bvh", "hero.json: does not match")])[-1] == "  in/x.bvh: hero.json: does not match"


def test_many_failures_are_not_all_listed():
    lines = summary([failed(f"{number}.bvh", "no") for number in range(50)])
    assert lines[-1] == "  and 30 more; metrics.csv has them all"
    assert len(lines) == 23


def test_clips_left_over_are_counted():
    assert summary([done("a.bvh", 0.1)], 5)[0] == "5 clips: 1 converted, 0 done before, 0 failed, 4 left"
    assert summary([done("a.bvh", 0.1)])[0] == "1 clip: 1 converted, 0 done before, 0 failed"
