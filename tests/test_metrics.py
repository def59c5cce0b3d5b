"""The registry of metrics: complete, and the only place that names, explains and reduces them."""

import re
from typing import get_args, get_type_hints

import numpy as np
import pytest
from bodies import ROOT, person, swaying

from distretarget.measure.diff import diff
from distretarget.measure.metrics import BY_KEY, METRICS, SUFFIXES, Limit, Metric, Track, frame_metrics

PACKAGE = ROOT / "distretarget"
REGISTRY = PACKAGE / "measure" / "metrics.py"
EXAMPLE = PACKAGE / "batch" / "record.py"  # with a verdict as an example of what is compressed
SOURCES = [
    path for kind in ("py", "js", "html") for path in PACKAGE.rglob(f"*.{kind}") if path not in (REGISTRY, EXAMPLE)
]
FRAMES = 5


def metric(**others):
    return Metric(**{"key": "gap", "label": "gap", "meaning": "gap of {result} against {source}"} | others)


def limit(**others):
    return Limit(reason="-", **others)


def test_keys_are_names_that_stand_once():
    assert len(BY_KEY) == len(METRICS)
    for one in METRICS:
        assert re.fullmatch(r"[a-z][a-z0-9_]*", one.key)
        assert not one.key.endswith(tuple(filter(None, SUFFIXES.values())))


def test_every_metric_has_a_track_and_every_track_a_metric():
    found = diff(swaying(person(), 6, seed=1), swaying(person(), 6, seed=2))
    assert set(found.tracks) == {one.track or one.key for one in METRICS}
    assert set(found.comparison.source_tracks) == {one.key for one in METRICS if one.of_source}


def test_the_choices_of_the_registry_are_known():
    types = get_type_hints(Metric)
    for one in METRICS:
        assert one.reduction in get_args(types["reduction"])
        assert one.judged in get_args(types["judged"])
        assert {*one.places} <= {*get_args(get_args(types["places"])[0])}
        assert one.limit is None or one.limit.of in get_args(get_type_hints(Limit)["of"])


def test_a_metric_may_be_missing_where_the_source_is_needed():
    for one in METRICS:
        assert one.missing or one.judged == "value"


def test_texts_use_the_given_names_of_the_motions():
    for one in METRICS:
        text = one.explanation("A", "B") + one.missing.format(source="A") + one.comparison("A", "B")
        assert "{" not in text
        assert one.explanation("A", "B")[0].isupper()
        assert text.count("source") == text.count("result") == 0


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_no_other_file_has_labels_units_or_meanings_of_its_own(path):
    text = path.read_text("utf-8")
    strings = [
        found[1] for found in re.findall(r"""(["'`])((?:(?!\1)[^\n])*)\1""", re.sub(r'""".*?"""', "", text, flags=re.S))
    ]
    for one in METRICS:
        telling = [words for words in (one.label, one.unit, one.meaning.split("{")[0]) if " " in words.strip()]
        for words in (*telling, *([one.symbol] if len(one.symbol) > 1 else [])):
            assert not [string for string in strings if words.lower() in string.lower()], words


# ---- from tracks to metrics


def test_a_mean_is_pooled_over_all_measurements():
    track = {"gap": Track(np.array([6.0, 0.0, 1.0]), np.array([3, 0, 1]))}
    assert metric().of_clip(track) == 7 / 4
    np.testing.assert_array_equal(metric().over_time(track, FRAMES), [2, np.nan, 1, np.nan, np.nan])


def test_only_what_counts_is_reduced():
    values, stance = np.array([[1.0, 9.0], [9.0, 9.0], [2.0, 3.0]]), np.array([[1, 0], [0, 0], [1, 1]], bool)
    track = {"gap": Track(values, stance)}
    assert metric().of_clip(track) == 2
    np.testing.assert_array_equal(metric().over_time(track, 3), [1, np.nan, 2.5])
    assert metric(reduction="largest").of_clip(track) == 3
    np.testing.assert_array_equal(metric(reduction="largest").over_time(track, 3), [1, np.nan, 3])
    assert metric(reduction="worst part").of_clip(track) == 3
    np.testing.assert_array_equal(metric(reduction="worst part").over_time(track, 3), [1, np.nan, 3])


def test_the_largest_is_at_least_zero():
    track = {"gap": Track(np.array([[-2.0, -1.0]]))}
    assert metric(reduction="largest").of_clip(track) == 0
    np.testing.assert_array_equal(metric(reduction="largest").over_time(track, 1), [0])


def test_a_percentile_is_of_another_track_and_has_no_frames():
    one = metric(key="gap_p99", track="gap", reduction="percentile 99")
    values = np.random.default_rng(0).normal(size=(FRAMES, 7))
    assert one.of_clip({"gap": Track(values)}) == np.percentile(values, 99)
    assert not one.of_frames


def test_frames_carry_the_suffix_of_their_side():
    track = Track(np.arange(3.0))
    columns = frame_metrics(
        {"source": {"foot_skate": track}, "rotation_copy": {"foot_skate": track}, "result": {"foot_skate": track}}, 3
    )
    assert list(columns) == ["foot_skate_source", "foot_skate_copy", "foot_skate"]


@pytest.mark.parametrize("shape", [(0,), (0, 4), (FRAMES, 0)])
def test_without_measurements_there_is_no_metric(shape):
    track = {"gap": Track(np.zeros(shape))}
    for reduction in ("mean", "worst part", "largest", "percentile 99", "frames"):
        assert metric(reduction=reduction).of_clip(track) is None
    assert np.isnan(metric().over_time(track, FRAMES)).all()


def test_what_a_limit_is_for():
    ratio = metric(judged="ratio", still=0.1)
    assert metric().judgement(2.0, None) == 2
    assert ratio.judgement(2.0, 4.0) == 0.5
    assert ratio.judgement(2.0, 0.05) == 20
    assert metric(judged="ratio").judgement(2.0, 0.0) is None
    assert {one.judgement(None, 1.0) for one in (metric(), ratio)} == {None}
    assert ratio.judgement(1.0, None) is None


def of_sides(result, copy=None, source=None):
    return {"result": {"gap": result}, "rotation_copy": {"gap": copy}, "source": {"gap": source}}


def test_a_metric_above_its_limit_has_a_warning():
    alone = metric(limit=limit(margin=3.0))
    assert [alone.over_limit(of_sides(value)) for value in (2.9, 3.0, 3.1, None)] == [False, False, True, False]
    assert not metric().over_limit(of_sides(1e9))
    of_copy = metric(limit=limit(margin=0.5, factor=2.0, of="rotation_copy"))
    assert [of_copy.over_limit(of_sides(2.6, copy)) for copy in (1.0, 1.1, None)] == [True, False, False]
    of_source = metric(limit=limit(margin=0.0, factor=1.5))
    assert [of_source.over_limit(of_sides(3.1, 0.0, source)) for source in (2.0, 2.1)] == [True, False]
    assert not of_copy.over_limit({"result": {"gap": 9.0}, "source": {}})


def test_a_metric_is_worse_than_the_copy_beyond_what_is_too_small_to_look_at():
    rival = metric(rivals_copy=True, least=0.1)
    assert [rival.worse_than_copy(of_sides(1.2, copy)) for copy in (1.0, 1.15, None)] == [True, False, False]
    assert not metric(least=0.1).worse_than_copy(of_sides(1.2, 1.0))
    assert not rival.worse_than_copy({"result": {"gap": 9.0}})


def test_frames_are_counted_in_which_any_value_is_above_zero():
    one = metric(reduction="frames")
    track = {"gap": Track(np.array([[0.0, 2.0], [0.0, 0.0], [3.0, 1.0]]))}
    assert one.of_clip(track) == 2
    np.testing.assert_array_equal(one.over_time(track, 4), [1, 0, 1, np.nan])
    assert one.of_clip({"gap": Track(np.zeros(3))}) == 0
