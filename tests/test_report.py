"""The report: its content, and its size; and in a browser, where every control works and bodies are in their places."""

import json
import re
import zlib
from base64 import b64decode
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import (
    APART,
    HERO,
    PERSON,
    SAMPLES,
    clapping,
    lengthened,
    moved,
    posed,
    sample_run,
    standing,
    swaying,
    tree_of,
    with_bone,
)
from pages import PATIENCE, check_it_asks_for_nothing, check_text_can_be_read, embedded, made_once, printed, settle
from scipy.spatial.transform import Rotation

from distretarget import load_target, read_bvh, read_motion, retarget, write_motion
from distretarget.contact_entries import Contact, ContactList
from distretarget.io.contacts_file import entry_to_json
from distretarget.io.input_file import load_file
from distretarget.measure.diff import diff
from distretarget.measure.metrics import METRICS, NOT_RUN, metrics_at
from distretarget.pipeline.found_contacts import contacts_of, marked_contacts
from distretarget.report.actors import encoded, thinned
from distretarget.report.clip_page import diff_page, run_diff, run_page
from distretarget.report.diff_document import About, document
from distretarget.report.page import script_json

NASTY = "</script><!--<b>&amp; \"q' ü \u2028\u2029 \ud800 {{stage}} __proto__ \u202e" + 10_000 * "x"


def about(**others):
    return About(**({"a": "a.bvh", "b": "b.bvh", "command": ""} | others))


def page_of(motion_a, motion_b, **others):
    difference = diff(motion_a, motion_b)
    return diff_page(difference, document(difference, about(**others)))


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
    assert len(check_it_asks_for_nothing(page_of(clap(), clap()))) == 2


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
    monkeypatch.setattr(thinned, "__defaults__", (10_000,))
    motion = swaying(PERSON, 400)
    one, _ = stage_of(motion, motion)["actors"]
    assert one["step"] > 1
    frames = len(numbers(one["path"], "<f4")) / 3
    assert (frames - 1) * one["step"] < len(motion) <= frames * one["step"]


def test_one_frame_without_contacts():
    motion = standing(APART, 1, height=0.9)
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


MARKUP = "</script><b>&amp; \"q' __proto__ \u202e" + 60 * "ü"
MINUS = "\u2212"
Z_UP = Rotation.from_matrix([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
CUT = """width => [...document.querySelectorAll('section, .metric, .bar > *, td')]
    .filter(one => one.checkVisibility() && one.getBoundingClientRect().right > width + 0.5)
    .map(one => one.outerHTML.slice(0, 200))"""  # what of a page is cut at its right
OFF = 1e-4 / 1.7  # 0.1 mm on a body of 1.7 m


def sample_page():
    limits = {"contact_error": 0.5, "foot_height": 1e-9}
    return run_page(
        sample_run("clap"),
        About(a="clap.bvh", b="clap_hero.glb", command="distretarget clap", limits=(*limits.items(),)),
    )


def compared(a, b, name="a.bvh"):
    result = diff(a, b)
    return diff_page(result, document(result, About(a=name, b=name, command=name)))


def nasty(name=MARKUP):
    body = with_bone(PERSON, name, "Hips")
    motion = swaying(body, 8, seed=2)
    names = tuple({"Head": f"Head{name}"}.get(one, one) for one in body.names)
    return compared(swaying(PERSON, 8, seed=1), replace(motion, skeleton=replace(body, names=names)), name)


def from_t_pose(frames=60):
    """A person who stands, after a first frame in T-pose."""
    down = np.r_[0.0, np.ones(frames - 1)][:, None] * [0.0, 0.0, 1.4]
    turns = {"LeftShoulder": -down, "RightShoulder": down}
    return posed(PERSON, turns, np.tile([0.0, 0.9, 0.0], (frames, 1)))


@cache
def asked_run():
    """A clap that is dropped in some frames, and a contact that is made."""
    contacts = (
        Contact(between=("left hand", "right hand"), frames=(100, 140), keep=False),
        Contact(between=("right hand", "head"), frames=(10, 20), gap=0.0),
    )
    return retarget(read_bvh(SAMPLES / "clap.bvh"), PERSON, contacts=ContactList(contacts))


MADE = {
    "sample": sample_page,
    "asked": lambda: run_page(asked_run(), About(a="a", b="b")),
    "one frame": lambda: compared(standing(APART, 1, height=0.9), standing(APART, 1, height=0.9)),
    "no contacts": lambda: compared(standing(APART, 5, height=0.9), standing(APART, 5, height=0.9)),
    "T-pose": lambda: compared(from_t_pose(), from_t_pose()),
    "nasty": nasty,
    "long name": lambda: nasty(10_000 * "x"),
    "Z up": lambda: compared(*[moved(swaying(PERSON, 40), Z_UP)] * 2),
}


@pytest.fixture(scope="module")
def reports(tmp_path_factory):
    """Makes a report once: its file."""
    return made_once(tmp_path_factory.mktemp("reports"), lambda name: MADE[name]())


@pytest.fixture
def opened(open_player, reports):
    """Opens a report in a tab."""
    return lambda name="sample", **options: open_player(reports(name), **options)


def frame(tab):
    """The number of the frame shown, from the text beside the slider."""
    settle(tab)
    return int(tab.inner_text("#now").split(" / ")[0])


def camera(tab):
    settle(tab)
    return np.array(tab.evaluate("app.stage.camera.position.toArray()"))


def picture(tab):
    return tab.evaluate("(app.stage.draw(app.clock.frame), $('player').toDataURL())")


def test_joints_and_vertices_are_where_the_result_has_them(opened):
    run, tab = sample_run("clap"), opened()
    unit, floor = 2 * run.matching.leg_lengths[1], None
    for number in (0, 100, len(run.motion) - 1):
        placed = (
            "number => { const {motion} = app.stage.actors[2]; motion.place(number); return [...motion.positions] }"
        )
        shown = np.array(tab.evaluate(placed, number)).reshape(-1, 3)
        expected = run.motion.positions[number] / unit
        floor = shown[0] - expected[0] if floor is None else floor
        np.testing.assert_allclose(floor[[0, 2]], 0, atol=OFF)
        np.testing.assert_allclose(shown - floor, expected, atol=OFF)
        chosen = np.linspace(0, len(run.mesh.vertices) - 1, 10).astype(int)
        vertices = tab.evaluate(
            """([number, chosen]) => {
                app.goTo(number);
                app.stage.draw(number);
                const {mesh} = app.stage.actors[2], x = new THREE.Vector3();
                return chosen.map(vertex => mesh.getVertexPosition(vertex, x).toArray());
            }""",
            [number, chosen.tolist()],
        )
        few = np.sort(run.mesh.weights[chosen], axis=1)[:, :-4].max(initial=0) == 0
        assert few
        expected = run.mesh.posed(run.motion[number : number + 1], chosen)[0] / unit
        np.testing.assert_allclose(np.array(vertices) - floor, expected, atol=OFF)


def test_of_a_file_with_z_up_y_is_up(opened):
    tab = opened("Z up")
    shown = np.array(tab.evaluate("(app.stage.actors[1].motion.place(7), [...app.stage.actors[1].motion.positions])"))
    motion = diff(*[moved(swaying(PERSON, 40), Z_UP)] * 2)
    expected = Z_UP.inv().apply(motion.b.positions[7]) / (2 * motion.matching.leg_lengths[1])
    shown = shown.reshape(-1, 3)
    np.testing.assert_allclose(shown - shown[0], expected - expected[0], atol=OFF)


def test_it_plays_in_real_time_stops_and_loops_and_the_space_bar_on_a_button_presses_it_only(opened):
    tab = opened()
    tab.select_option("#speed", "4")
    shown = tab.evaluate("(setPlaying(true), tick(before + 250), app.clock.frame)")
    assert shown == pytest.approx(4 * 60 / 4, abs=1)
    assert tab.get_attribute("#play", "aria-label") == "Stop"
    tab.click("#play")
    assert tab.get_attribute("#play", "aria-label") == "Play"
    stopped = frame(tab)
    settle(tab)
    assert frame(tab) == stopped
    for number in (40, 50):
        tab.evaluate("number => app.goTo(number)", number)
        tab.click("#loop")
    assert tab.inner_text("#loop") == "Loop 40 – 50"  # noqa: RUF001
    for passed in (0.1, 0.2, 3.0):
        assert 40 <= tab.evaluate("passed => (advanced(passed))", passed) <= 50
    tab.click("#loop")
    assert tab.inner_text("#loop") == "Loop"
    tab.focus("#overlaid")
    tab.keyboard.press("Space")
    assert tab.get_attribute("#overlaid", "aria-pressed") == "true"
    assert tab.get_attribute("#play", "aria-label") == "Play"


def test_keys_move_the_frame_and_the_camera(opened):
    tab = opened()
    last = tab.evaluate("app.clock.count - 1")
    for key, expected in (
        ("ArrowRight", 1),
        ("Shift+ArrowRight", 11),
        ("ArrowLeft", 10),
        ("Shift+ArrowLeft", 0),
        ("End", last),
        ("ArrowRight", last),
        ("Home", 0),
    ):
        tab.keyboard.press(key)
        assert frame(tab) == expected, key
    jumps = sorted(tab.evaluate("app.clock.jumps.map(one => one.frame)"))
    tab.keyboard.press("n")
    assert frame(tab) == next(one for one in jumps if one > 0)
    before = camera(tab)
    distance = np.linalg.norm(before)
    for key in ("a", "w", "Shift+d", "+"):
        tab.keyboard.press(key)
        assert np.abs(camera(tab) - before).max() > 1e-3, key
        before = camera(tab)
    assert np.linalg.norm(before) < distance
    for key, name in (("o", "overlaid"), ("f", "follow"), ("t", "trails"), ("m", "marks")):
        pressed = tab.get_attribute(f"#{name}", "aria-pressed")
        tab.keyboard.press(key)
        assert tab.get_attribute(f"#{name}", "aria-pressed") != pressed
    tab.keyboard.press("?")
    assert tab.is_visible("#keys")
    assert "full screen" in tab.inner_text("#keys")
    tab.keyboard.press("Escape")
    assert not tab.is_visible("#keys")
    settle(tab)
    assert tab.evaluate("document.activeElement.id") == "player"
    tab.keyboard.press("Space")
    assert tab.get_attribute("#play", "aria-label") == "Stop"


TO = """hash => new Promise(heard => {
    addEventListener('hashchange', () => heard(), {once: true});
    location.hash = hash;
})"""


def test_a_link_leads_to_a_frame_and_the_address_follows(opened):
    tab = opened()
    tab.evaluate(TO, "#frame=66")
    assert frame(tab) == 66
    tab.keyboard.press("ArrowRight")
    assert tab.evaluate("location.hash") == "#frame=67"
    for other in ("#frame=99999", "#frame=-1", "#frame=x"):
        tab.evaluate(TO, other)
    assert frame(tab) == tab.evaluate("app.clock.count - 1")


def test_what_is_chosen_by_mouse_goes_to_that_frame(opened):
    tab = opened()
    box = tab.locator(".track").first.bounding_box()
    tab.mouse.click(box["x"] + 0.25 * box["width"], box["y"] + 5)
    assert abs(frame(tab) - 0.25 * tab.evaluate("app.clock.count - 1")) < 2
    tab.fill("#slider", "66")
    assert frame(tab) == 66
    option = tab.locator("#jump option").nth(1)
    tab.select_option("#jump", option.get_attribute("value"))
    assert f"{frame(tab)}" in option.inner_text()
    button = tab.locator(".worst button").last
    button.click()
    assert button.inner_text().endswith(f" {frame(tab)}")
    tab.locator("td button").first.click()
    assert frame(tab) == int(tab.locator("td button").first.inner_text())


def test_contacts_are_copied_as_entries_of_a_contact_file(opened):
    tab, run = opened("asked"), asked_run()
    marked = marked_contacts(run, contacts_of(run.baseline))
    told = {(each.mark, entry_to_json(each.entry)) for each in marked}
    for name, number, expected, frames in (
        ("left hand - right hand", 120, "dropped", None),
        ("right hand - head", 200, "added", [10, 20]),
    ):
        row = tab.evaluate(
            "name => app.marks.rows.findIndex(row => row.name.split(' - ').sort().join() === name)",
            ",".join(sorted(name.split(" - "))),
        )
        tab.locator(".name").nth(row).focus()
        tab.evaluate("number => app.goTo(number)", number)
        settle(tab)
        mark, _, text = tab.inner_text("#entry").partition(": ")
        assert mark == expected
        assert (mark, text) in told
        assert frames is None or json.loads(text)["frames"] == frames
        tab.keyboard.press("c")
        settle(tab)
        assert tab.inner_text("#entry") == f"copied: {text}"
    names = tab.locator(".name").all_inner_texts()
    assert {frozenset(name.split(" - ")) for name in names[:2]} == {
        frozenset(("left hand", "right hand")),
        frozenset(("right hand", "head")),
    }
    assert not opened("no contacts").is_visible("#copy")


def test_sides_are_hidden_and_laid_over_each_other(opened):
    tab = opened()
    assert tab.locator("#labels > div").all_inner_texts() == ["Source", "Copied rotations", "Result"]
    tab.locator("#sides button").nth(1).click()
    assert tab.locator("#labels > div").all_inner_texts() == ["Source", "Result"]
    tab.click("#overlaid")
    assert tab.locator("#labels > div").count() == 1
    tab.click("#overlaid")
    for k in (0, 2):
        tab.locator("#sides button").nth(k).click()
    assert tab.locator("#labels > div").all_inner_texts() == ["Result"]


def elements(content, at=0):
    """The elements of Matroska in some bytes, by number, with their content."""
    while at < len(content):
        width = next(size for size in range(1, 5) if content[at] >> (8 - size))
        number, at = int.from_bytes(content[at : at + width], "big"), at + width
        size, at = int.from_bytes(content[at + 1 : at + 8], "big"), at + 8  # the page writes all sizes in eight bytes
        yield number, content[at : at + size]
        at += size


def test_a_film_has_each_frame_once_and_at_its_time(opened, tmp_path):
    tab = opened("Z up")
    if not tab.evaluate("Boolean(globalThis.VideoEncoder)"):
        pytest.skip("this browser codes no films")
    count, step = tab.evaluate("[app.clock.count, app.clock.frameTime]")
    with tab.expect_download(timeout=PATIENCE) as saved:
        tab.click("#film")
    saved.value.save_as(tmp_path / "film.webm")
    (_, head), (_, segment) = elements((tmp_path / "film.webm").read_bytes())
    times = []
    for number, cluster in elements(segment):
        if number == 0x1F43B675:
            (_, start), *blocks = elements(cluster)
            times += [int.from_bytes(start, "big") + int.from_bytes(block[1:3], "big") for _, block in blocks]
    assert b"webm" in head
    np.testing.assert_allclose(times, 1000 * step * np.arange(count), atol=1)


def test_the_picture_changes_with_frame_theme_and_paths(opened):
    tab = opened(color_scheme="light")
    seen = [picture(tab)]
    tab.evaluate("app.goTo(100)")
    settle(tab)
    seen.append(picture(tab))
    tab.click("#trails")
    settle(tab)
    seen.append(picture(tab))
    tab.click("#theme")
    settle(tab)
    seen.append(picture(tab))
    assert len(set(seen)) == 4
    with tab.expect_download() as saved:
        tab.click("#picture")
    assert saved.value.suggested_filename == "frame_100.png"


def test_on_a_phone_a_finger_turns_the_view_and_nothing_is_cut(opened):
    tab = opened(width=390, height=844, has_touch=True, color_scheme="dark")
    assert tab.locator("#labels > div").all_inner_texts() == ["Source", "Result"]
    before = camera(tab)
    tab.evaluate("""() => {
        const canvas = $('player'), send = (type, x) => canvas.dispatchEvent(new PointerEvent(
            type, {pointerId: 1, clientX: x, clientY: 300, pointerType: 'touch', bubbles: true, button: 0}));
        canvas.setPointerCapture = canvas.releasePointerCapture = () => {};
        send('pointerdown', 100);
        for (const x of [120, 150]) (canvas.ownerDocument, send('pointermove', x));
        send('pointerup', 150);
    }""")
    assert np.abs(camera(tab) - before).max() > 0.01
    for name in ("sample", "nasty", "long name"):
        tab = opened(name, width=390, height=844)
        for width in (320, 390, 900):
            tab.set_viewport_size({"width": width, "height": 844})
            settle(tab)
            assert tab.evaluate("document.scrollingElement.scrollWidth") <= width
            assert not tab.evaluate(CUT, width)


@pytest.mark.parametrize("width", [390, 1360])
def test_a_pose_before_the_motion_is_in_view(opened, width):
    tab = opened("T-pose", width=width, height=844)
    off = tab.evaluate("""() => Math.max(...app.stage.actors.flatMap(({mesh}) => {
        const x = new THREE.Vector3(), at = k => mesh.localToWorld(mesh.getVertexPosition(k, x));
        return [...mesh.geometry.attributes.position.array.keys()].filter(k => k % 3 === 0)
            .map(k => Math.abs(at(k / 3).project(app.stage.camera).x));
    }))""")
    assert 0.2 < off < 1


def test_curves_that_are_out_of_view_wait_until_the_clip_stops(opened):
    tab = opened(width=1360, height=768)
    moved_on = """() => new Promise(done => {
        const first = app.clock.frame;
        app.setPlaying(true);
        onFrame(frame => { if (frame > first + 10) done(); });
    })"""

    def line():
        return tab.locator(".curve .line").last.get_attribute("style")

    drawn = """expected => document.querySelectorAll(".curve .line[style]").length === expected"""
    tab.wait_for_function(drawn, arg=len(metrics_at("curve")))
    settle(tab)
    before = line()
    tab.evaluate(moved_on)
    assert line() == before
    tab.evaluate("app.setPlaying(false)")
    settle(tab)
    stopped = line()
    assert stopped != before
    tab.locator(".curve").last.scroll_into_view_if_needed()
    settle(tab)
    tab.evaluate(moved_on)
    assert line() != stopped


def test_two_fingers_that_part_zoom_in(opened):
    tab = opened(width=390, height=844, has_touch=True, is_mobile=True)
    box, session = tab.locator("#player").bounding_box(), tab.context.new_cdp_session(tab)
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    distance = "app.stage.camera.position.distanceTo(app.stage.controls.target)"
    before = tab.evaluate(distance)
    for kind, apart in (("touchStart", 40), ("touchMove", 60), ("touchMove", 80), ("touchEnd", 0)):
        fingers = [{"x": x + sign * apart, "y": y} for sign in (-1, 1)] if apart else []
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": fingers})
    settle(tab)
    assert tab.evaluate(distance) == pytest.approx(before / 2, rel=0.1)
    assert tab.evaluate("visualViewport.scale") == 1


def test_the_player_fills_the_screen_and_leaves_it(opened):
    tab = opened(width=1360, height=768)
    shown = "document.fullscreenElement?.id ?? null"
    for expected in ("stage-box", None):
        tab.keyboard.press("x")
        tab.wait_for_function(f"({shown}) === {json.dumps(expected)}")
        settle(tab)
        assert tab.evaluate("$('stage-box').scrollHeight") <= 768
    box = tab.locator(".transport").bounding_box()
    assert box["y"] + box["height"] <= 768


def test_nothing_moves_by_itself_for_those_who_prefer_no_motion(opened):
    tab = opened(reduced_motion="reduce")
    moving = "[...document.querySelectorAll('*')].some(one => parseFloat(getComputedStyle(one).transitionDuration) > 0)"
    assert not tab.evaluate(moving)
    assert not tab.evaluate("app.clock.playing")


def rounded(text):
    """The number that is shown and half of its last digit."""
    number = text.replace(MINUS, "-").lstrip("<>")
    digits = len(number.partition(".")[2])
    return float(number), (1.0 if text[0] in "<>" else 0.5) * 10.0**-digits * 1.001


def assert_shown(text, value):
    number, most = rounded(text)
    assert number == pytest.approx(value, abs=most)


def assert_inside(one, other):
    """That one element lies in another, within a pixel."""
    inner, outer = one.bounding_box(), other.bounding_box()
    for side, size in (("x", "width"), ("y", "height")):
        assert outer[side] - 1 <= inner[side]
        assert inner[side] + inner[size] <= outer[side] + outer[size] + 1


def test_a_run_opens_with_its_verdict_and_controls_with_names(opened):
    tab, run = opened(), sample_run("clap")
    assert tab.inner_text("#verdict") == run.verdict
    assert tab.locator("#warnings li").all_inner_texts() == [*run.warnings]
    assert tab.inner_text("#title") == "result clap_hero.glb against source clap.bvh" == tab.title()
    diffed = opened("no contacts")
    assert not diffed.locator("#verdict").is_visible()
    assert diffed.inner_text("#contacts") == "No two regions of the body touch in A."
    assert "B moves like A in every frame" in diffed.locator("#worst p").inner_text()
    unnamed = """() => [...document.querySelectorAll("button, input, select, summary, a[href], [tabindex='0']")]
        .filter(one => !(one.getAttribute('aria-label') || one.textContent.trim())).map(one => one.outerHTML)"""
    assert not tab.evaluate(unnamed)
    snapshot = tab.locator("body").aria_snapshot()
    assert not re.search(r"- (button|slider|combobox|link)\s*$", snapshot, re.MULTILINE)
    assert 'combobox "Speed"' in snapshot
    assert "frame 0" in tab.get_attribute("#player", "aria-label")
    assert "pinch zooms" in tab.evaluate("$($('player').getAttribute('aria-describedby')).textContent")


def test_cards_show_metrics_and_limits_inside_them_and_rows_their_values(opened):
    tab, run = opened(), sample_run("clap")
    values = document(run_diff(run), About(a="", b="", rotation_copy=run.tracks["rotation_copy"]))["metrics"]
    first = metrics_at("card")
    cards = tab.locator(".metric").all()
    for metric, card in zip((*first, *(one for one in METRICS if one not in first)), cards, strict=True):
        name = f"{metric.label}, {metric.symbol}" if metric.symbol else metric.label
        assert card.locator("h3").inner_text() == name[0].upper() + name[1:]
        if values["result"][metric.key] is None:
            assert card.locator(".big").inner_text() == metric.missing.format(source="A")
            continue
        rows = dict(zip(*(card.locator(tag).all_inner_texts() for tag in ("dt", "dd")), strict=True))
        assert_shown(card.locator(".big").inner_text(), values["result"][metric.key] * metric.factor)
        if metric.key not in NOT_RUN and "copy" in rows:
            assert_shown(rows["copy"], values["rotation_copy"][metric.key] * metric.factor)
        if metric.of_source:
            assert_shown(rows["A"], values["source"][metric.key] * metric.factor)
    lines = [line for line in tab.locator(".limit").all_inner_texts() if "limit" in line]
    assert lines[0] == "✓ within limit 0.5"
    assert any(line.startswith("✗ over limit ") for line in lines)
    tab.evaluate("for (const one of document.querySelectorAll('.timeline .value')) one.className = 'value over'")
    words = {"within": 0, "over": 0}
    for card in tab.locator(".metric").all():
        for line in card.locator(".limit").all():
            words["over" if "over" in line.inner_text() else "within"] += 1
            assert_inside(line, card)
    assert min(words.values()) > 0
    rows = tab.locator(".timeline .name").all(), tab.locator(".timeline .value").all()
    assert len(rows[0]) > 0
    for name, value in zip(*rows, strict=True):
        beside, own = name.bounding_box(), value.bounding_box()
        assert beside["y"] - 1 <= own["y"] + own["height"] / 2 <= beside["y"] + beside["height"] + 1


def test_one_frame_has_nothing_to_play(opened):
    tab = opened("one frame")
    assert tab.is_disabled("#play")
    assert tab.is_disabled("#slider")
    tab.keyboard.press("Space")
    tab.keyboard.press("ArrowRight")
    assert frame(tab) == 0


def test_names_are_text(opened):
    tab = opened("nasty")
    assert tab.inner_text("#title") == f"{MARKUP} against {MARKUP}"
    assert f"1 joint of B without a counterpart in A: {MARKUP}." in tab.inner_text("#notes")
    assert tab.inner_text("code") == MARKUP
    assert not tab.evaluate("[...document.querySelectorAll('b')].filter(one => !one.closest('.readout')).length")


def test_screen_readers_are_not_told_of_every_frame(opened):
    tab = opened("asked")
    changed = tab.evaluate("""() => new Promise(done => {
        const told = new Set();
        new MutationObserver(changes => changes.forEach(({target}) => {
            const around = target.nodeType === Node.ELEMENT_NODE ? target : target.parentElement;
            const one = around.closest('output, [role=status]');
            if (one && one.ariaLive !== 'off') told.add(one.id);
        })).observe(document.body, {subtree: true, childList: true, characterData: true});
        onFrame(frame => { if (frame > 30) done([...told]); });
        app.setPlaying(true);
    })""")
    assert set(changed) <= {"entry"}  # what can be copied changes from contact to contact


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_text_can_be_read(opened, theme):
    check_text_can_be_read(opened(color_scheme=theme))


def test_print_shows_every_section_on_white(opened):
    tab = opened(color_scheme="dark")
    with printed(tab):
        for section in tab.locator("main section:not([hidden])").all():
            assert section.is_visible()
        for hidden in ("#theme", "#play"):
            assert not tab.is_visible(hidden)
