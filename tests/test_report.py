"""The report, without a browser: its content, its size, and how accurate the drawing is."""

import json
import re
from base64 import b64decode
from dataclasses import replace

import numpy as np
import pytest
from bodies import SAMPLES, clapping, lengthened, person, posed, swaying, with_bone

from distretarget import Skeleton, read_bvh
from distretarget.measure.diff import diff
from distretarget.numerics.time_series import spans_of
from distretarget.report.clip_page import diff_drawing, diff_page
from distretarget.report.diff_document import About, document
from distretarget.report.page import BUDGET, SCRIPTS, STEPS, drawn_step, quantised, script_json

PERSON = person()
NASTY = "</script><!--<b>&amp; \"q' ü \u2028\u2029 \ud800 {{drawing}}"


def about(**others):
    return About(**({"a": "a.bvh", "b": "b.bvh", "command": "", "version": "0"} | others))


def page_of(motion_a, motion_b, **others):
    difference = diff(motion_a, motion_b)
    return diff_page(difference, document(difference, about(**others)))


def embedded(text, name):
    """The JSON of a script element, which ends where a browser ends it: at the first `</script`."""
    start = text.index(f'<script type="application/json" id="{name}">')
    return json.loads(text[text.index(">", start) + 1 : text.index("</script", start)])


def numbers(text, dtype, shape):
    return np.frombuffer(b64decode(text), dtype).reshape(shape)


def clap(frames=12):
    return clapping(np.sin(np.linspace(0, np.pi, frames)))


def positions_of(drawing):
    q = numbers(drawing["positions"], "<i2", (-1, len(drawing["names"]), 3))
    return np.array(drawing["offset"]) + np.array(drawing["scale"]) * q


def chain(joints):
    offsets = np.tile([[0.0, 1.0, 0.0]], (joints, 1))
    channels = (("Zrotation", "Xrotation", "Yrotation"),) * joints
    names = tuple(f"joint_{k}" for k in range(joints))
    return Skeleton(
        names=names, parents=np.arange(joints) - 1, offsets=offsets, channels=channels, end_sites=np.zeros(joints, bool)
    )


def test_names_of_all_kinds_stay_text():
    names = list(PERSON.names)
    names[PERSON.index("Head")] = NASTY
    body = replace(PERSON, names=tuple(names))
    motion = replace(clap(), skeleton=body)
    text = page_of(motion, motion, a=NASTY, b=NASTY, command=NASTY)
    assert text.encode("utf-8")
    plain = page_of(clap(), clap())
    for mark in ("<script", "</script", "<!--", "<b>"):
        assert text.count(mark) == plain.count(mark)
    assert embedded(text, "document")["a"]["file"] == NASTY
    assert NASTY in embedded(text, "drawing")["b"]["names"]
    assert embedded(text, "document")["program"]["command"] == NASTY


def test_json_in_a_script_is_the_same_json():
    value = {"<>&": ["\u2028\u2029", None, 1.5, -3, "ü\\u003c"]}
    assert json.loads(script_json(value)) == value
    assert not set("<>&\u2028\u2029") & set(script_json(value))


def test_the_document_stands_in_the_page_as_it_is():
    difference = diff(clap(), clap())
    whole = document(difference, about())
    assert embedded(diff_page(difference, whole), "document") == json.loads(json.dumps(whole))


def test_the_page_is_one_file_that_asks_for_nothing():
    text = page_of(clap(), clap())
    assert not re.search(r'(src|href)="(?!#|data:)', text)
    assert "@import" not in text
    assert "default-src 'none'" in text
    assert "{{" not in text
    assert text.count("'use strict';") == 1
    for scripts in SCRIPTS.values():
        assert len(set(scripts)) == len(scripts)


def test_scripts_make_no_markup_of_text():
    assert not re.search(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|eval\(", page_of(clap(), clap()))


def test_five_thousand_frames_of_sixty_joints_take_less_than_9_mb():
    motion = swaying(chain(60), 5000)
    text = page_of(motion, motion)
    assert len(text.encode()) < 9e6
    assert embedded(text, "drawing")["step"] == 1


def test_positions_are_off_by_at_most_half_a_step_of_their_box():
    x = np.random.default_rng(0).normal(size=(50, 7, 3)) * [1.0, 100.0, 1e-3] + [0, 1e4, 0]
    x[..., 2] = 0.25
    q, offset, scale = quantised(x)
    assert q.dtype == np.int16
    assert (np.abs(offset + scale * q - x) <= 0.5001 * np.ptp(x, axis=(0, 1)) / STEPS + 1e-11).all()
    np.testing.assert_array_equal((offset + scale * q)[..., 2], 0.25)


@pytest.mark.parametrize("up", ["Y", "Z"])
def test_the_drawing_stands_upright_on_the_floor_and_keeps_D(up):
    a = read_bvh(SAMPLES / "walk.bvh")
    if up == "Z":
        turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
        from bodies import moved
        from scipy.spatial.transform import Rotation

        a = moved(a, Rotation.from_matrix(turn))
    drawn = diff_drawing(diff(a, a))
    x = positions_of(drawn["b"])
    assert abs(np.percentile(x[..., 1].min(axis=1), 2)) < 1e-3
    assert 0.9 < np.ptp(x[0], axis=0)[1] < 1.4
    points = drawn["b"]["points"]
    tau = numbers(drawn["b"]["tau"], "<f4", (len(points), len(points)))
    body = a.rigid_skeleton
    i, j = np.argwhere(tau > 0).T
    D = np.linalg.norm(x[5, points][i] - x[5, points][j], axis=1) / tau[i, j]
    own = np.linalg.norm(a.positions[5, points][i] - a.positions[5, points][j], axis=1)
    np.testing.assert_allclose(D, own / body.path_lengths[points][:, points][i, j], atol=2e-3)


def test_a_long_clip_is_thinned_and_says_so():
    motion = swaying(PERSON, 40_000)
    joints = 2 * len(PERSON)
    step = drawn_step(len(motion), joints)
    assert step > 1
    drawn = diff_drawing(diff(motion, motion))
    assert drawn["step"] == step
    assert any(f"one frame in {step}" in note for note in drawn["notes"])
    frames = len(positions_of(drawn["a"]))
    assert (frames - 1) * step < len(motion) <= frames * step
    assert 2 * frames * len(PERSON) * 6 <= BUDGET + joints * 6
    assert drawn_step(1, 40) == drawn_step(100, 40) == 1


def test_one_frame():
    text = page_of(clap(1), clap(1))
    drawn = embedded(text, "drawing")
    assert len(positions_of(drawn["a"])) == 1
    assert drawn["step"] == 1


def test_no_contacts():
    spread = {"LeftHip": np.array([0, 0, 0.5]), "RightHip": np.array([0, 0, -0.5])}
    motion = posed(PERSON, spread, np.tile([0.0, 0.9, 0.0], (5, 1)))
    drawn = diff_drawing(diff(motion, motion))
    assert drawn["contacts"] == []
    assert document(diff(motion, motion), about())["figures"]["result"]["contact_error"] is None


def test_the_scale_of_differences_is_of_pairs_with_a_length_in_both():
    flat = {"Neck", "Head", "Chest3", "Chest4"}
    body = PERSON.with_lengths(np.where([name in flat for name in PERSON.names], 0.0, PERSON.lengths))
    drawn = diff_drawing(diff(swaying(body, 4), swaying(PERSON, 4)))
    assert drawn["largest_difference"] < 0.9


def test_contact_spans_are_the_runs_of_contact_in_both():
    a = clapping(np.array([0, 1, 1, 0, 0, 1, 0.0]))
    b = replace(a, skeleton=PERSON)
    drawn = diff_drawing(diff(a, b))
    assert document(diff(a, b), about())["contacts"][0]["regions"] == "left hand - right hand"
    row = drawn["contacts"][0]
    assert row["a"] == row["b"] == [[1, 3], [5, 6]]
    assert spans_of(np.array([True, True, False, True])).tolist() == [[0, 2], [3, 4]]
    assert spans_of(np.zeros(3, bool)).tolist() == []


def test_contacts_are_those_of_the_document():
    a = clap()
    longer = lengthened(PERSON, {"Elbow": 1.5})
    difference = diff(a, replace(a, skeleton=longer))
    whole = document(difference, about())
    drawn = diff_drawing(difference)
    names, points = drawn["b"]["names"], drawn["b"]["points"]
    found = [[names[points[k]] for k in contact["pair"]] for contact in drawn["contacts"]]
    assert found == [contact["joints_b"] for contact in whole["contacts"]]
    assert found


def test_bones_carry_how_far_they_are_off_and_those_without_a_counterpart_are_marked():
    body = with_bone(PERSON, "Tail", PERSON.names[0])
    turned = {"LeftElbow": np.radians([0, 0, 40.0])}
    a, b = (posed(*one, np.tile([0.0, 0.9, 0.0], (4, 1))) for one in ((PERSON, {}), (body, turned)))
    errors = numbers(diff_drawing(diff(a, b))["bone_errors"], "<u1", (4, len(body)))
    assert set(errors[:, body.index("Tail")]) == set(errors[:, 0]) == {255}
    assert set(errors[:, body.index("LeftWrist")]) == {80}
    assert set(errors[:, body.index("LeftElbow")]) == {0}
    opposite = posed(PERSON, {"LeftElbow": np.radians([0, 0, 179.0])}, np.tile([0.0, 0.9, 0.0], (4, 1)))
    errors = numbers(diff_drawing(diff(a, opposite))["bone_errors"], "<u1", (4, len(PERSON)))
    assert set(errors[:, PERSON.index("LeftWrist")]) == {254}
