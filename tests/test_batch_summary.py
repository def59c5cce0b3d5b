"""The summary of a run."""

from pathlib import Path, PurePath

from input_files import named_target

from distretarget.batch.plan import Clip
from distretarget.batch.record import new_record
from distretarget.batch.tally import Tally


def record(name):
    return new_record(Clip(Path(name), named_target("{}", "hero.json"), PurePath(name), 1), {})


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


def test_the_summary_counts_clips_and_names_the_worst():
    lines = summary(
        [None, *(done(f"{number}.bvh", number / 10) for number in range(5)), failed("x.bvh", "x.bvh:3: no")]
    )
    assert lines == [
        "7 clips: 5 converted, 1 done before, 1 failed",
        "500 frames in 2.0 s, 250 frames/s with 2 jobs",
        "worst contact error: 4.bvh (0.4, rotation copy 0.4), 3.bvh (0.3, rotation copy 0.3), "
        "2.bvh (0.2, rotation copy 0.2)",
        "worst stress: 0.bvh (1, rotation copy 1), 1.bvh (0.9, rotation copy 0.9), 2.bvh (0.8, rotation copy 0.8)",
        "failed:",
        "  x.bvh:3: no",
    ]


def test_a_failure_names_its_clip():
    assert summary([failed("in/x.bvh", "hero.json: does not match")])[-1] == "  in/x.bvh: hero.json: does not match"


def test_many_failures_are_not_all_listed():
    lines = summary([failed(f"{number}.bvh", "no") for number in range(50)])
    assert lines[-1] == "  and 30 more; the manifest has them all"
    assert len(lines) == 23


def test_clips_over_their_limits_are_counted():
    records = [done("a.bvh", 0.0), done("b.bvh", 0.0) | {"warnings": ["one", "two"]}, done("c.bvh", 0.0)]
    assert summary(records)[2] == "1 of 3 have warnings, which are in metrics.csv"
    assert not any("have warnings" in line for line in summary(records[:1]))


def test_clips_left_over_are_counted():
    assert summary([done("a.bvh", 0.1)], 5)[0] == "5 clips: 1 converted, 0 done before, 0 failed, 4 left"
    assert summary([done("a.bvh", 0.1)])[0] == "1 clip: 1 converted, 0 done before, 0 failed"
