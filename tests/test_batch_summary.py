"""The summary of a run."""

from pathlib import Path

from input_files import named_target

from distretarget.batch.plan import Clip
from distretarget.batch.record import new_record
from distretarget.batch.summary import Tally


def record(name):
    return new_record(Clip(Path(name), named_target("{}", "hero.json"), (name,), 1), {})


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
        "worst contact error: 4.bvh (0.4000, copied rotations 0.4000), 3.bvh (0.3000, copied rotations 0.3000), "
        "2.bvh (0.2000, copied rotations 0.2000)",
        "worst stress [\N{MULTIPLICATION SIGN} 1000]: 0.bvh (1000.00, copied rotations 1000.00), "
        "1.bvh (900.00, copied rotations 900.00), 2.bvh (800.00, copied rotations 800.00)",
        "failed:",
        "  x.bvh:3: no",
    ]


def test_numbers_of_the_worst_have_units_and_no_rounding_errors():
    one = done("a.bvh", 1e-5)
    one["metrics"] |= {"direction_error": 12.34, "direction_error_copy": 3.12e-14, "hips_height": 3e-14}
    lines = [line for line in summary([one]) if line.startswith("worst ") and "stress" not in line]
    assert lines == ["worst direction error [°]: a.bvh (12.3, copied rotations 0.0)"]


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
