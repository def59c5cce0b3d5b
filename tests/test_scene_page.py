"""The report on a scene: everybody in one player, and rows of what touches."""

import zlib
from base64 import b64decode
from functools import cache

import numpy as np
import pytest
from bodies import SAMPLES
from pages import embedded, settle
from program import succeeded

from distretarget import SettingsError, diff, diff_scenes, retarget_scene, write_scene_report
from distretarget.measure.metrics import BY_KEY
from distretarget.report.scene_page import scene_page
from distretarget.scene.scene_file import load_scene


@cache
def page(name):
    setup = load_scene(SAMPLES / "scenes" / name / "scene.json")
    return scene_page(setup.retargeted(), setup.names)


def data(name, part="stage"):
    return embedded(page(name), part)


def test_everybody_and_everything_is_in_it():
    stage = data("staff")
    shown = [(actor["name"], actor["role"], actor["side"]) for actor in stage["actors"]]
    assert shown == [
        (name, role, side) for side in (0, 1, 2) for name, role in (("performer", "other"), ("staff", "prop"))
    ]
    assert stage["frames"] == 157
    (table,) = data("staff", "numbers")
    ((between, frames, *gaps),) = table["rows"]
    assert (between, frames) == ("performer and staff", "157")
    assert all(float(gap) >= 0 for gap in gaps)


def test_a_row_holds_while_hands_touch():
    stage = data("high_five")
    rows = [row for row in stage["rows"] if "'s" in row["name"]]
    assert rows
    touched = np.zeros(121, bool)
    for row in rows:
        touched |= np.frombuffer(zlib.decompress(b64decode(row["codes"])), np.uint8) > 0
        for side, points in enumerate(row["points"]):
            assert [stage["actors"][actor]["side"] for actor, _ in points] == [side, side]
    assert touched[54:61].all()
    assert not touched[:20].any()


def test_rows_of_performers_with_skins_are_of_gaps_between_these():
    setup = load_scene(SAMPLES / "scenes" / "high_five" / "scene.json")
    motions = setup.read()[0]
    result = retarget_scene(motions, [motion.rigid_skeleton for motion in motions], skin="average")
    stage, numbers = (embedded(scene_page(result, setup.names), part) for part in ("stage", "numbers"))
    assert numbers[0]["rows"][0][3] == result.skin_gaps[0, 1].worst.frame
    rows = {row["name"]: row for row in stage["rows"]}
    one, other = setup.names
    row = rows[f"{one}'s right hand - {other}'s right hand"]
    assert row["unit"] == BY_KEY["skin_gap"].symbol
    codes = np.frombuffer(zlib.decompress(b64decode(row["codes"])), np.uint8)
    hands = ("right hand", "right hand")
    frames = [touch.frame for touch in result.skin_gaps[0, 1].touches if touch.parts == hands]
    np.testing.assert_array_equal(np.flatnonzero(codes), np.unique(frames))
    assert all(len(points) == 2 for points in row["points"])


def test_a_part_that_nothing_drives_has_a_row_without_marks():
    setup = load_scene(SAMPLES / "scenes" / "high_five" / "scene.json")
    motions = [motion[54:61] for motion in setup.read()[0]]
    bodies = [motion.rigid_skeleton for motion in motions]
    maps = [dict.fromkeys(("RightElbow", "RightWrist"))] * 2
    result = retarget_scene(motions, bodies, skin="average", joint_maps=maps)
    rows = embedded(scene_page(result, setup.names), "stage")["rows"]
    assert any(row["points"] == [[], [], []] for row in rows if "hand" in row["name"])


def test_the_command_writes_it(tmp_path):
    succeeded("scene", SAMPLES / "scenes" / "staff", "-o", tmp_path, "--report", tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text("utf-8") == page("staff")


def test_python_writes_it_and_that_of_a_diff(tmp_path):
    setup = load_scene(SAMPLES / "scenes" / "staff" / "scene.json")
    result = setup.retargeted()
    write_scene_report(tmp_path / "scene.html", result, setup.names)
    assert (tmp_path / "scene.html").read_text("utf-8") == page("staff")
    performers = [diff(one.source, one.motion) for one in result.results]
    difference = diff_scenes(performers, [(prop.source, prop.motion) for prop in result.props])
    write_scene_report(tmp_path / "diff.html", difference, setup.names, a_name="take 1", b_name="take 2")
    text = (tmp_path / "diff.html").read_text("utf-8")
    assert "A: take 1" in text
    assert "B: take 2" in text
    assert "performer's" in text


@pytest.mark.parametrize("names", [[], ["performer"], ["staff", "staff"], ["performer", "staff", "more"]])
def test_names_that_do_not_fit_are_refused(names, tmp_path):
    setup = load_scene(SAMPLES / "scenes" / "staff" / "scene.json")
    with pytest.raises(SettingsError, match="expected 2 different names"):
        write_scene_report(tmp_path / "scene.html", setup.retargeted(), names)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("name", "theme", "width"), [("waltz", "light", 1360), ("sit_on_chair", "dark", 390)])
def test_it_plays_in_a_browser(name, theme, width, tmp_path, open_player):
    file = tmp_path / "report.html"
    file.write_text(page(name), "utf-8")
    tab = open_player(file, width=width, color_scheme=theme)
    assert tab.locator("#now").inner_text().startswith("0 / 156")
    tab.keyboard.press("Shift+ArrowRight")
    settle(tab)
    assert tab.locator("#now").inner_text().startswith("10 / 156")
    assert tab.locator("#tables tbody tr").count() == 1
    assert tab.locator("#labels > div").count() == (3 if width > 1000 else 2)
    assert tab.evaluate("document.scrollingElement.scrollWidth") <= width
    for cell in tab.locator("tbody th, tbody td").all():
        assert cell.bounding_box()["x"] + cell.bounding_box()["width"] <= width
    before = tab.evaluate("getComputedStyle(document.body).backgroundColor")
    tab.click("#theme")
    assert tab.evaluate("getComputedStyle(document.body).backgroundColor") != before
    tab.keyboard.press("End")
    settle(tab)
    assert tab.locator("#now").inner_text().startswith("156 / 156")
