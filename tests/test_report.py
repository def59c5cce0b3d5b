"""The report, without a browser: its content, its size, and what it says of contacts."""

import hashlib
import json
import re
import zlib
from base64 import b64decode, b64encode
from dataclasses import replace

import numpy as np
from bodies import HERO, PERSON, SAMPLES, clapping, lengthened, posed, swaying, tree_of

from distretarget import load_target, read_bvh, read_motion, retarget, write_motion
from distretarget.io.input_file import load_file
from distretarget.measure.diff import diff
from distretarget.report.actors import encoded
from distretarget.report.clip_page import diff_page, run_page
from distretarget.report.diff_document import About, document
from distretarget.report.page import script_json
from distretarget.report.stage import stage_data

NASTY = "</script><!--<b>&amp; \"q' ü \u2028\u2029 \ud800 {{stage}} __proto__ \u202e" + 10_000 * "x"


def about(**others):
    return About(**({"a": "a.bvh", "b": "b.bvh", "command": ""} | others))


def page_of(motion_a, motion_b, **others):
    difference = diff(motion_a, motion_b)
    return diff_page(difference, document(difference, about(**others)))


def embedded(text, name):
    """The JSON of a script element, which ends where a browser ends it: at the first `</script`."""
    start = text.index(f'<script type="application/json" id="{name}">')
    return json.loads(text[text.index(">", start) + 1 : text.index("</script", start)])


def stage_of(motion_a, motion_b):
    return embedded(page_of(motion_a, motion_b), "stage")


def numbers(text, dtype):
    """The numbers of a encoded array."""
    planes = np.frombuffer(zlib.decompress(b64decode(text)), np.uint8).reshape(np.dtype(dtype).itemsize, -1)
    return np.ascontiguousarray(planes.T).view(dtype).ravel()


def clap(frames=12):
    return clapping(np.sin(np.linspace(0, np.pi, frames)))


def chain(joints):
    return tree_of(np.tile([[0.0, 1.0, 0.0]], (joints, 1)))


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
    assert NASTY in embedded(text, "stage")["actors"][1]["names"]
    assert embedded(text, "document")["program"]["command"] == NASTY


def test_json_in_a_script_is_the_same_json():
    value = {"<>&": ["\u2028\u2029", None, 1.5, -3, "ü\\u003c"]}
    assert json.loads(script_json(value)) == value
    assert not set("<>&\u2028\u2029") & set(script_json(value))


def test_the_document_stands_in_the_page_but_for_its_frames():
    difference = diff(clap(), clap())
    whole = document(difference, about())
    text = diff_page(difference, whole)
    there = embedded(text, "document")
    assert {key: there[key] for key in whole if key != "frames"} == json.loads(
        json.dumps({key: whole[key] for key in whole if key != "frames"})
    )
    stress = numbers(embedded(text, "columns")["stress"], "<f4")
    np.testing.assert_allclose(stress, [row["stress"] for row in whole["frames"]], rtol=1e-6, atol=1e-30)


def test_the_page_is_one_file_that_asks_for_nothing_and_runs_only_its_own_scripts():
    text = page_of(clap(), clap())
    assert not re.search(r'(src|href)="(?!#|data:)', text)
    assert "@import" not in text
    assert "default-src 'none'" in text
    assert "{{" not in text
    scripts = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    assert len(scripts) == 2
    (policy,) = re.findall(r"script-src (.*?);", text)
    assert policy.split() == [
        f"'sha256-{b64encode(hashlib.sha256(one.encode()).digest()).decode()}'" for one in scripts
    ]


def test_scripts_make_no_markup_of_text():
    own = re.findall(r"<script>(.*?)</script>", page_of(clap(), clap()), re.DOTALL)[1]
    assert not re.search(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|eval\(|Function\(|fetch\(", own)


def test_packed_numbers_are_the_same_numbers():
    for dtype in ("<f4", "<i2", "<u1", "<u4"):
        values = np.arange(24).reshape(2, 3, 4).astype(dtype)
        np.testing.assert_array_equal(numbers(encoded(values, dtype), dtype), values.ravel())


def test_five_thousand_frames_of_sixty_joints_take_less_than_9_mb():
    motion = swaying(chain(60), 5000)
    text = page_of(motion, motion)
    assert len(text.encode()) < 9e6
    assert embedded(text, "stage")["actors"][0]["step"] == 1


def test_a_long_clip_is_thinned(monkeypatch):
    monkeypatch.setattr(stage_data, "__defaults__", (50_000, ()))
    motion = swaying(PERSON, 2000)
    one, _ = stage_of(motion, motion)["actors"]
    assert one["step"] > 1
    frames = len(numbers(one["path"], "<f4")) / 3
    assert (frames - 1) * one["step"] < len(motion) <= frames * one["step"]


def test_one_frame_without_contacts():
    spread = {"LeftHip": np.array([0, 0, 0.5]), "RightHip": np.array([0, 0, -0.5])}
    motion = posed(PERSON, spread, np.tile([0.0, 0.9, 0.0], (1, 1)))
    stage = stage_of(motion, motion)
    assert stage["frames"] == len(numbers(stage["actors"][0]["path"], "<f4")) / 3 == 1
    assert not [row for row in stage["rows"] if " - " in row["name"]]


def test_a_row_holds_where_the_regions_touch_and_joins_the_joints_of_the_document():
    a = clapping(np.array([0, 1, 1, 0, 0, 1, 0.0]))
    difference = diff(a, replace(a, skeleton=lengthened(PERSON, {"Elbow": 1.5})))
    whole = document(difference, about())
    stage = embedded(diff_page(difference, whole), "stage")
    row, contact = stage["rows"][0], whole["contacts"][0]
    assert row["name"] == contact["regions"] == "left hand - right hand"
    assert (numbers(row["codes"], "<u1") > 0).tolist() == [False, True, True, False, False, True, False]
    for side, joints in enumerate((contact["joints_a"], contact["joints_b"])):
        assert [stage["actors"][actor]["names"][joint] for actor, joint in row["points"][side]] == joints
        assert {actor for actor, _ in row["points"][side]} == {side}
    off = (numbers(row["codes"], "<u1")[[1, 2, 5]] - 1) / 254 * row["top"]
    skin = difference.comparison.tracks["skin_gap"]
    hands = np.where(skin.weights > 0, skin.values, 0.0)[[1, 2, 5], :2].max(axis=1)
    np.testing.assert_allclose(off, hands, atol=row["top"] / 254)
    assert {"frame": 1, "kind": "Contacts", "text": "left hand - right hand \u00b7 1"} in stage["jumps"]


def test_a_source_with_a_mesh_is_shown_with_it(tmp_path):
    clip = retarget(read_bvh(SAMPLES / "clap.bvh")[:5], load_target(HERO)).motion
    write_motion(tmp_path / "clap.glb", clip, HERO)
    file = load_file(tmp_path / "clap.glb")
    motion = read_motion(tmp_path / "clap.glb")
    result = retarget(motion, PERSON)
    for source, own in ((file, True), (load_file(SAMPLES / "clap.bvh"), False), (load_file(HERO), True)):
        stage = embedded(run_page(result, about(), None, source), "stage")
        assert ["mesh" in stage["bodies"][actor["body"]] for actor in stage["actors"]] == [own, False, False]
