"""The registry of metrics; verdict, warnings and causes: what they say of known metrics, and nothing else."""

import re
from dataclasses import replace
from functools import cache
from typing import get_args, get_type_hints

import numpy as np
import pytest
from bodies import ROOT, person, posed, sample, swaying

from distretarget import retarget
from distretarget.measure.diff import diff
from distretarget.measure.metrics import BY_KEY, METRICS, SUFFIXES, Limit, Metric, Track, frame_metrics
from distretarget.measure.verdict import limit_warnings, verdict
from distretarget.objectives.supports import no_supports
from distretarget.pipeline.causes import Causes

NOTHING = {metric.key: None for metric in METRICS}
TRACKS = {
    "direction_error": Track(np.array([[1.0, 2.0], [12.4, 0.0]]), parts=("Neck", "LeftArm")),
    "hips_height": Track(np.array([[0.1, 0.2], [0.1, 7.0]])),
}
GOOD = {"contact_error": 0.01, "foot_skate": 0.001, "hips_height_largest": 0.57}


def said(result, copy=None, source=None, tracks=TRACKS):
    metrics = {"result": NOTHING | result, "rotation_copy": NOTHING | (copy or {}), "source": source or {}}
    return "".join(verdict(metrics, {"source": {}, "rotation_copy": {}, "result": tracks}))


def test_a_good_run():
    assert said(GOOD, {"contact_error": 0.041}, {"foot_skate": 0.001}) == (
        "Contacts kept 4.1 times better than by copied rotations; feet do not skate; hips height kept within "
        "0.6 % of a leg; largest direction error: Neck, 12 degrees at frame 1."
    )


@pytest.mark.parametrize(
    ("result", "copy", "words"),
    [
        (None, None, "There are no self-contacts to keep;"),
        (0.01, 0.0105, "Contacts kept as well as by copied rotations;"),
        (0.0005, 0.001, "Contacts kept as well as by copied rotations;"),
        (0.03, 0.01, "Contacts kept worse than by copied rotations;"),
        (0.0, 0.05, "Contacts kept more than 100 times better than by copied rotations;"),
    ],
)
def test_contacts(result, copy, words):
    assert said(GOOD | {"contact_error": result}, {"contact_error": copy}).startswith(words)


@pytest.mark.parametrize(
    ("result", "source", "words"),
    [
        (None, None, "no foot is planted in the source"),
        (0.1, 0.1, "feet skate no more than in the source"),
        (0.2, 0.1, "feet skate more than in the source"),
    ],
)
def test_feet(result, source, words):
    assert f"; {words};" in said(GOOD | {"foot_skate": result}, source={"foot_skate": source})


@pytest.mark.parametrize(("error", "words"), [(9.14, "9.1"), (12.4, "12"), (99.6, "100"), (104.3, "104")])
def test_degrees_are_plain_numbers(error, words):
    turned = TRACKS | {"direction_error": Track(np.array([[error]]), parts=("Neck",))}
    assert f"Neck, {words} degrees at frame 0." in said(GOOD, tracks=turned)


def test_what_rests_less_than_in_the_copy_is_not_praised():
    text = said(GOOD | {"foot_skate": 0.05}, {"foot_skate": 0.02}, {"foot_skate": 0.05})
    assert "; feet skate more than with copied rotations;" in text
    assert text.endswith(" Within limits, but worse than copied rotations: foot skate.")
    supported = {"support_skate": 0.01, "support_height": 0.9}
    text = said(GOOD | supported, {"support_skate": 0.01, "support_height": 0.1}, {"support_skate": 0.01})
    assert "; hands, knees or other supports stay in place less than with copied rotations;" in text


def test_limbs_that_sink_into_the_body_are_named_with_their_frame():
    deep = TRACKS | {"skin_depth": Track(np.array([[0.0, 0.1], [0.0, 2.34]]), parts=("left hand", "right hand"))}
    text = said(GOOD | {"skin_depth": 2.34}, tracks=deep)
    assert "; right hand sinks up to 2.3 % of the height into the body at frame 1; feet" in text
    assert text.endswith(" Check: skin inside.")
    assert "; skin stays outside; feet" in said(GOOD | {"skin_depth": 0.2}, tracks=deep)
    assert "; skin stays outside, within 0.4 % of the height; feet" in said(GOOD | {"skin_depth": 0.4}, tracks=deep)
    assert "skin" not in said(GOOD)


@pytest.mark.parametrize(
    ("gap", "words"),
    [
        (None, "There are no self-contacts to keep;"),
        (0.02, "Skin touches as in the source, within 0.1 % of the height;"),
        (0.5, "Skin touches as in the source, within 0.5 % of the height;"),
        (0.6, "A hand or forearm misses what it touches by 0.6 % of the height on average;"),
        (1.6, "A hand or forearm misses what it touches by 1.6 % of the height on average;"),
    ],
)
def test_contacts_of_skins(gap, words):
    deep = TRACKS | {"skin_depth": Track(np.zeros((2, 2)), parts=("left hand", "right hand"))}
    assert said(GOOD | {"skin_depth": 0.0, "skin_gap": gap}, tracks=deep).startswith(words)


def test_hips_that_are_off_are_named_with_their_frame_and_are_over_the_limit():
    text = said(GOOD | {"hips_height_largest": 12.2})
    assert "hips height off by up to 12 % of a leg at frame 1" in text
    assert text.endswith(" Check: largest hips height.")
    text = said(GOOD | {"hips_height_largest": 3.2, "hips_height": 3.0})
    assert "hips height off by up to 3 % of a leg at frame 1" in text
    assert text.endswith(" Check: hips height.")
    assert "hips height kept within 7.2 % of a leg" in said(GOOD | {"hips_height_largest": 7.2, "hips_height": 1.0})


def test_metrics_over_their_limits_are_named_once():
    text = said(GOOD | {"foot_height": 9.0, "pop": 2.0}, {"foot_height": 1.0})
    assert text.endswith(". Check: foot height, pops.")
    empty = {"direction_error": Track(np.zeros((3, 0))), "hips_height": Track(np.zeros((3, 0)))}
    assert said({}, tracks=empty) == "There are no self-contacts to keep; no foot is planted in the source."


def lines(result, copy=None, source=None, tracks=None):
    metrics = {"result": NOTHING | result, "rotation_copy": NOTHING | (copy or {}), "source": source or {}}
    sides = {side: {} for side in SUFFIXES} | {"result": tracks or {}}
    return list(limit_warnings(metrics, sides))


def test_a_metric_above_its_limit_names_value_frame_and_part_and_the_cause_if_one_was_found():
    tracks = {"foot_height": Track(np.array([[1.0, 2.0], [3.0, 17.0]]), parts=("LeftFoot", "RightFoot"))}
    assert lines({"foot_height": 5.75}, tracks=tracks) == [
        "foot height 5.75 % of leg length, limit 2.2; worst in frame 1, RightFoot"
    ]
    assert lines({"foot_height": 5.75}, {"foot_height": 0.5}, tracks=tracks)[0].startswith(
        "foot height 5.75 % of leg length (0.5 in the rotation copy), limit 2.2; "
    )

    metrics = {"result": NOTHING | {"foot_height": 5.75}, "rotation_copy": NOTHING, "source": {}}
    asked = []

    def cause_of(metric, frame, part):
        asked.append((metric.key, frame, part))
        return "the leg is straight"

    (line,) = limit_warnings(metrics, {"result": tracks}, cause_of)
    assert asked == [("foot_height", 1, "RightFoot")]
    assert line.endswith("worst in frame 1, RightFoot; cause: the leg is straight")


def test_time_inside_leads_to_where_the_skin_is_deepest():
    depths = Track(np.array([[0.0, 0.2], [0.0, 2.0], [1.0, 0.0]]), parts=("left hand", "right hand"))
    tracks = {"skin_frames": Track(np.array([0.0, 100.0, 100.0])), "skin_depth": depths}
    assert BY_KEY["skin_frames"].worst(tracks) == (1, "right hand")


def test_limits_of_source_and_copy():
    tracks = {"jerk": Track(np.array([1.0, 5.0, 2.0])), "foot_skate": Track(np.array([[0.0, 0.1]]))}
    assert lines({"jerk": 4.6}, {"jerk": 1.0}, tracks=tracks) == ["jerk 4.6 body sizes/s³, limit 4.5; worst in frame 1"]
    assert lines({"jerk": 4.4}, {"jerk": 1.0}, tracks=tracks) == []
    assert lines({"jerk": 0.015}, {"jerk": 0.0}, tracks=tracks) == []  # a pose that is held still
    (line,) = lines({"foot_skate": 0.2}, {"foot_skate": 0.3}, {"foot_skate": 0.1}, tracks)
    assert line.startswith("foot skate 0.2 leg lengths/s, limit 0.135; worst in frame 0")


def test_metrics_within_their_limits_or_not_measured_are_no_warning():
    result = {"foot_height": 0.5, "hips_height": 2.0, "jerk": 9.0}
    assert lines(result, {"foot_height": 0.1, "hips_height": 0.5, "jerk": 8.0}) == []
    assert lines({}) == []
    track = Track(np.array([[np.nan, 2.0], [9.0, 1.0]]), np.array([[False, True], [False, True]]), ("a", "b"))
    assert BY_KEY["foot_height"].worst({"foot_height": track}) == (0, "b")


def test_every_limit_says_what_it_means():
    for metric in METRICS:
        if metric.limit:
            assert metric.limit.reason
            assert metric.limit.formula(metric.unit)
    formulas = {metric.key: metric.limit.formula(metric.unit) for metric in METRICS if metric.limit}
    assert formulas["jerk"] == "1.5 times the rotation copy's + 3 body sizes/s³"
    assert formulas["foot_skate"] == "1.15 times the source's + 0.02 leg lengths/s"
    assert formulas["contact_error"] == "the rotation copy's + 0.002"
    assert formulas["not_converged"] == "0"


DOWN = np.array([0.0, 0.0, 1.4])


@cache
def result():
    return retarget(sample("clap"), person())


def causes(**turns):
    """Those of one pose of a person, who is straight but for the turns of joints, in two frames."""
    motion = posed(person(), turns, np.tile([0.0, 0.9, 0.0], (2, 1)))
    run = result()
    return Causes(motion, run.matching, no_supports(2), run.effort)


def with_rest(weights, name="LeftAnkle"):
    """Those of a person with a joint that rests so much in each of two frames."""
    known, joint = causes(), np.array([person().names.index(name)])
    rests = no_supports(2).with_joints(joint, joint, np.array(weights)[:, None], np.zeros((2, 1, 3)))
    return replace(known, supports=rests)


@pytest.mark.parametrize("key", ["foot_skate", "foot_height", "hips_height_largest"])
def test_a_straight_leg_reaches_no_farther(key):
    straight, bent = causes(), causes(LeftKnee=np.array([0.6, 0.0, 0.0]))
    words = "the left leg is straight and reaches no farther"
    assert straight.of(BY_KEY[key], 0, "LeftAnkle") == words
    assert straight.of(BY_KEY[key], 0, "RightAnkle") == words.replace("left", "right")
    assert bent.of(BY_KEY[key], 0, "LeftAnkle") == ""
    assert bent.of(BY_KEY[key], 0, "RightAnkle") == words.replace("left", "right")


def test_a_straight_arm_reaches_no_farther():
    gap = BY_KEY["skin_gap"]
    assert causes().of(gap, 0, "left hand") == "the left arm is straight and reaches no farther"
    assert causes(LeftElbow=np.array([0.0, 0.9, 0.0])).of(gap, 0, "left hand") == ""
    assert causes().of(BY_KEY["support_height"], 0, "LeftKnee") == ""  # a knee is no end of a leg


def test_a_rest_that_begins_or_ends_in_that_limb_makes_it_pop():
    for key in ("pop", "turn"):
        assert with_rest([0.0, 1.0]).of(BY_KEY[key], 0, "LeftKnee") == "LeftAnkle comes to rest"
        assert with_rest([1.0, 0.0]).of(BY_KEY[key], 1, "LeftKnee") == "LeftAnkle leaves its rest"
        assert with_rest([1.0, 1.0]).of(BY_KEY[key], 1, "LeftKnee") == ""
        assert with_rest([0.0, 1.0]).of(BY_KEY[key], 0, "RightKnee") == ""


def test_a_hand_that_rests_is_held_where_skin_sinks_in():
    depth = BY_KEY["skin_depth"]
    assert with_rest([0.0, 1.0], "LeftWrist").of(depth, 1, "left hand") == "LeftWrist is held where it rests"
    assert with_rest([0.0, 1.0], "LeftWrist").of(depth, 0, "left hand") == ""
    assert with_rest([0.0, 1.0], "LeftWrist").of(depth, 1, "right hand") == ""


def test_alignment_is_blamed_on_rest_poses_alone_in_which_nobody_stands():
    known = causes()
    lying = replace(known.matching, source=replace(known.matching.source))
    assert known.of(BY_KEY["head_tilt"], 0, "Head") == ""
    lying.source.__dict__["stands_at_rest"] = False
    assert replace(known, matching=lying).of(BY_KEY["head_tilt"], 0, "Head") == (
        "nobody can stand in the rest pose of the source"
    )


def test_a_solver_that_stopped_says_after_how_many_steps():
    known = causes()
    assert known.of(BY_KEY["not_converged"], 3, "") == f"the solver stopped after {known.effort.iterations[3]} steps"
    assert causes().of(BY_KEY["jerk"], 0, "") == causes().of(BY_KEY["turn"], 0, "Neck") == ""


PACKAGE = ROOT / "distretarget"
REGISTRY = PACKAGE / "measure" / "metrics.py"
EXAMPLE = PACKAGE / "batch" / "results.py"  # with a verdict as an example of what is compressed
SOURCES = [
    path for kind in ("py", "js", "html") for path in PACKAGE.rglob(f"*.{kind}") if path not in (REGISTRY, EXAMPLE)
]
FRAMES = 5


def metric(**others):
    return Metric(**{"key": "gap", "label": "gap", "meaning": "gap of {result} against {source}"} | others)


def limit(**others):
    return Limit(reason="-", **others)


def test_the_registry_has_known_choices_and_a_track_for_each_metric():
    assert len(BY_KEY) == len(METRICS)
    for one in METRICS:
        assert re.fullmatch(r"[a-z][a-z0-9_]*", one.key)
        assert not one.key.endswith(tuple(filter(None, SUFFIXES.values())))
    found = diff(swaying(person(), 6, seed=1), swaying(person(), 6, seed=2))
    assert set(found.tracks) == {one.track or one.key for one in METRICS}
    assert set(found.comparison.source_tracks) == {one.key for one in METRICS if one.of_source}
    types = get_type_hints(Metric)
    for one in METRICS:
        assert one.reduction in get_args(types["reduction"])
        assert one.judged in get_args(types["judged"])
        assert {*one.places} <= {*get_args(get_args(types["places"])[0])}
        assert one.limit is None or one.limit.of in get_args(get_type_hints(Limit)["of"])
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


def test_only_what_counts_is_reduced():
    values, stance = np.array([[1.0, 9.0], [9.0, 9.0], [2.0, 3.0]]), np.array([[1, 0], [0, 0], [1, 1]], bool)
    track = {"gap": Track(values, stance)}
    assert metric().of_clip(track) == 2
    np.testing.assert_array_equal(metric().over_time(track, 3), [1, np.nan, 2.5])
    assert metric(reduction="largest").of_clip(track) == 3
    np.testing.assert_array_equal(metric(reduction="largest").over_time(track, 3), [1, np.nan, 3])
    assert metric(reduction="worst part").of_clip(track) == 3
    np.testing.assert_array_equal(metric(reduction="worst part").over_time(track, 3), [1, np.nan, 3])


def test_means_largest_values_percentiles_and_counts_of_frames_are_known():
    track = {"gap": Track(np.array([[-2.0, -1.0]]))}
    assert metric(reduction="largest").of_clip(track) == 0
    np.testing.assert_array_equal(metric(reduction="largest").over_time(track, 1), [0])
    track = {"gap": Track(np.array([6.0, 0.0, 1.0]), np.array([3, 0, 1]))}
    assert metric().of_clip(track) == 7 / 4
    np.testing.assert_array_equal(metric().over_time(track, FRAMES), [2, np.nan, 1, np.nan, np.nan])
    one = metric(key="gap_p99", track="gap", reduction="percentile 99")
    values = np.random.default_rng(0).normal(size=(FRAMES, 7))
    assert one.of_clip({"gap": Track(values)}) == np.percentile(values, 99)
    assert not one.of_frames
    one = metric(reduction="frames")
    track = {"gap": Track(np.array([[0.0, 2.0], [0.0, 0.0], [3.0, 1.0]]))}
    assert one.of_clip(track) == 2
    np.testing.assert_array_equal(one.over_time(track, 4), [1, 0, 1, np.nan])
    assert one.of_clip({"gap": Track(np.zeros(3))}) == 0


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
    rival = metric(compared_with_copy=True, least=0.1)
    assert [rival.worse_than_copy(of_sides(1.2, copy)) for copy in (1.0, 1.15, None)] == [True, False, False]
    assert not metric(least=0.1).worse_than_copy(of_sides(1.2, 1.0))
    assert not rival.worse_than_copy({"result": {"gap": 9.0}})
