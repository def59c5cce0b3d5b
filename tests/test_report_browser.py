"""The report in a browser: it loads nothing else, it plays, and every control works."""

import re
from dataclasses import replace

import numpy as np
import pytest
from bodies import SAMPLES, person, posed, swaying, with_bone
from pages import CONTRASTS, settle

from distretarget import load_target, read_bvh, retarget
from distretarget.measure.diff import diff
from distretarget.measure.figures import BY_KEY, FIGURES, NOT_RUN, figures_at
from distretarget.report.clip_page import diff_page, run_diff
from distretarget.report.diff_document import About, document

NASTY = "</script><b>&amp; \"q' " + 60 * "ü"
PERSON = person()
APART = {"LeftHip": np.array([0, 0, 0.5]), "RightHip": np.array([0, 0, -0.5])}
LIMITS = tuple(
    {"contact_error": 0.02, "slide": 1.1, "foot_height": 0.5, "stress": 0.03, "jerk": 1.01, "bone_error": 1e-6}.items()
)
THEMES = ("light", "dark")
BETWEEN = " \u2013 "  # the two joints of a pair
MINUS = "\u2212"


def sample():
    """A real run, with the rotation copy and limits: the difference, and its document."""
    source = read_bvh(SAMPLES / "clap.bvh")
    run = retarget(source, load_target(SAMPLES / "long_arms.json").for_source(source.rigid_skeleton).skeleton)
    of_run = run_diff(run)
    return of_run, document(
        of_run,
        About(
            a="clap.bvh",
            b="clap_long_arms.bvh",
            command="distretarget diff",
            version="1",
            rotation_copy=run.tracks["rotation_copy"],
            verdict=run.verdict,
            warnings=("a line", NASTY),
            limits=LIMITS,
        ),
    )


def still(frames, body=PERSON):
    """A person with the feet apart, who touches nothing."""
    return posed(body, APART, np.tile([0.0, 0.9, 0.0], (frames, 1)))


def compared(a, b, name="a.bvh"):
    result = diff(a, b)
    return result, document(result, About(a=name, b=name, command=name, version="1"))


def renamed(motion, names):
    """The motion with other names of joints, by their old ones."""
    body = motion.skeleton
    return replace(motion, skeleton=replace(body, names=tuple(names.get(name, name) for name in body.names)))


def namespaced(motion):
    return renamed(motion, {name: f"rig:{name}" for name in motion.skeleton.names})


def fast(seed):
    return replace(swaying(PERSON, 200, seed=seed), frame_time_text="0.005")


def jolted(motion):
    """A motion with one frame out of place, and so with a very large jerk there."""
    path = np.array(motion.root_positions)
    path[60] += 100
    return replace(motion, root_positions=path)


def nasty():
    body = with_bone(PERSON, NASTY, "Hips")
    return compared(swaying(PERSON, 8, seed=1), renamed(swaying(body, 8, seed=2), {"Head": f"Head{NASTY}"}), NASTY)


MADE = {
    "sample": sample,
    "one frame": lambda: compared(still(1), still(1)),
    "no contacts": lambda: compared(still(5), still(5)),
    "nasty": nasty,
    "namespace": lambda: compared(fast(1), namespaced(jolted(fast(2)))),
    "thinned": lambda: compared(swaying(PERSON, 900), swaying(PERSON, 900, seed=1)),
}


@pytest.fixture(scope="module")
def reports(tmp_path_factory):
    """Makes a report once: its file, and its document."""
    folder, made = tmp_path_factory.mktemp("reports"), {}

    def report(name):
        if name not in made:
            result, figures = MADE[name]()
            path = folder / f"{name}.html"
            path.write_text(diff_page(result, figures), "utf-8")
            made[name] = path, figures
        return made[name]

    return report


@pytest.fixture
def opened(open_page, reports):
    """Opens a report in a tab."""
    return lambda name="sample", **options: open_page(reports(name)[0], **options)


def frame(tab):
    """The number of the frame shown, from the text beside the slider."""
    settle(tab)
    return int(tab.inner_text("#now").split(" / ")[0])


def picture(tab, selector="#player"):
    settle(tab)
    return tab.evaluate("name => document.querySelector(name).toDataURL()", selector)


def scrolled(tab):
    """Scroll through the whole page, so that all of it is drawn."""
    for top in range(0, tab.evaluate("document.documentElement.scrollHeight"), 400):
        tab.evaluate("top => scrollTo(0, top)", top)
        settle(tab)


def test_it_plays_and_stops(opened):
    tab = opened()
    tab.click("#play")
    assert tab.get_attribute("#play", "aria-label") == "Stop"
    tab.wait_for_selector("#now:not(:text-matches('^[0-9] /'))")
    tab.click("#play")
    assert tab.get_attribute("#play", "aria-label") == "Play"
    stopped = frame(tab)
    settle(tab)
    assert frame(tab) == stopped > 9


def test_the_speed_is_that_of_the_clip_times_the_choice(opened):
    tab = opened()
    tab.select_option("#speed", "4")
    shown = tab.evaluate("(setPlaying(true), tick(before + 250), setPlaying(false), state.frame)")
    assert shown == pytest.approx(4 * 60 / 4, abs=1)


def test_it_starts_again_after_the_last_frame(opened, reports):
    tab = opened()
    tab.keyboard.press("End")
    assert frame(tab) == reports("sample")[1]["frame_count"] - 1
    reached = tab.evaluate("(setPlaying(true), tick(before + 250), setPlaying(false), state.frame)")
    assert reached == pytest.approx(60 / 4 - 1, abs=1)


def test_the_slider_moves_frame_figures_and_picture(opened, reports):
    tab, row = opened(), reports("sample")[1]["frames"][66]
    before = picture(tab)
    tab.fill("#slider", "66")
    assert frame(tab) == 66
    assert picture(tab) != before
    assert tab.inner_text("#now").endswith(f"{row['time']:.2f} s")
    assert float(tab.locator(".readout").first.inner_text()) == pytest.approx(row["contact_error"], abs=5e-5)
    assert f"{row['contacts']} contacts" in tab.get_attribute("#player", "aria-label")


def test_a_click_on_a_curve_goes_to_that_frame(opened, reports):
    tab = opened()
    for curve, share in ((0, 0.25), (4, 0.8)):
        box = tab.locator(".plot canvas").nth(curve).bounding_box()
        tab.mouse.click(box["x"] + share * box["width"], box["y"] + 20)
        assert abs(frame(tab) - share * (reports("sample")[1]["frame_count"] - 1)) < 1


def test_a_click_on_a_contact_goes_there_and_chooses_it(opened):
    tab = opened()
    tab.locator(".track svg").first.click(position={"x": 100, "y": 8})
    assert frame(tab) > 0
    assert BETWEEN in tab.inner_text("#selected")
    tab.locator(".contacts .name").last.click()
    settle(tab)
    assert tab.evaluate("pairName(drawing.contacts[drawing.contacts.length - 1].pair)") in tab.inner_text("#selected")


def test_the_theme_can_be_switched(opened):
    tab = opened(color_scheme="light")
    seen = []
    for label in ("Dark", "Light", "Dark"):
        assert tab.inner_text("#theme") == label
        seen.append((picture(tab), tab.evaluate("getComputedStyle(document.body).backgroundColor")))
        tab.click("#theme")
    assert seen[0] == seen[2]
    assert seen[0][0] != seen[1][0]
    assert seen[0][1] != seen[1][1]
    assert opened(color_scheme="dark").inner_text("#theme") == "Light"


def test_keys_move_the_frame_and_the_camera(opened, reports):
    last = reports("sample")[1]["frame_count"] - 1
    tab = opened()
    for key, expected in (
        ("ArrowRight", 1),
        ("Shift+ArrowRight", 11),
        ("ArrowLeft", 10),
        ("Shift+ArrowLeft", 0),
        ("ArrowLeft", 0),
        ("End", last),
        ("ArrowRight", last),
        ("Home", 0),
    ):
        tab.keyboard.press(key)
        assert frame(tab) == expected, key
    tab.focus("#slider")
    tab.keyboard.press("Shift+ArrowRight")
    assert frame(tab) == 10
    before = picture(tab)
    tab.keyboard.press("+")
    assert picture(tab) != before
    tab.keyboard.press("-")
    assert picture(tab) == before
    tab.keyboard.press("Space")
    assert tab.get_attribute("#play", "aria-label") == "Stop"
    tab.keyboard.press("Space")
    assert tab.get_attribute("#play", "aria-label") == "Play"


def test_the_space_bar_on_a_button_presses_it_only(opened):
    tab = opened()
    tab.focus("#overlaid")
    tab.keyboard.press("Space")
    assert tab.get_attribute("#overlaid", "aria-pressed") == "true"
    assert tab.get_attribute("#play", "aria-label") == "Play"


def test_a_cell_of_a_matrix_names_its_joints_and_marks_them(opened):
    tab = opened()
    tab.locator(".matrices canvas").first.scroll_into_view_if_needed()
    names = tab.evaluate("[1, 4].map(point => B.names[B.points[point]])")
    before = picture(tab)
    box = tab.locator(".matrices canvas").nth(1).bounding_box()
    size = box["width"] / tab.evaluate("pointCount")
    tab.mouse.move(box["x"] + 4.5 * size, box["y"] + 1.5 * size)
    settle(tab)
    assert BETWEEN.join(names) in tab.inner_text("#cell")
    assert BETWEEN.join(names) in tab.inner_text("#selected")
    assert picture(tab) != before
    tab.locator(".matrices canvas").nth(1).focus()
    tab.keyboard.press("ArrowRight")
    settle(tab)
    assert names[0] in tab.inner_text("#cell")
    assert names[1] not in tab.inner_text("#cell")
    assert frame(tab) == 0


def test_buttons_of_worst_frames_and_contacts_go_there(opened, reports):
    tab, figures = opened(), reports("sample")[1]
    tab.locator(".worst button").first.click()
    assert frame(tab) == figures["worst"]["contact_error"]
    tab.keyboard.press("End")
    tab.locator("td button").first.click()
    contact = figures["contacts"][0]
    assert frame(tab) == contact["worst_frame"]
    assert BETWEEN.join(contact["joints_b"]) in tab.inner_text("#selected")


def test_the_table_of_contacts_has_all_of_them_hands_first(opened, reports):
    rows = opened().locator("tbody th").all_inner_texts()
    contacts = reports("sample")[1]["contacts"]
    assert [row.split("\n")[0] for row in rows] == [contact["regions"] for contact in contacts]
    assert rows[0].startswith("left hand - right hand")


def test_buttons_switch_overlay_camera_and_view(opened):
    tab = opened()
    tab.keyboard.press("End")
    seen = [picture(tab)]
    for name in ("overlaid", "overlaid"):
        tab.click(f"#{name}")
        seen.append(picture(tab))
    assert seen[0] == seen[2] != seen[1]
    assert tab.get_attribute("#overlaid", "aria-pressed") == "false"
    tab.click("#follow")
    assert tab.get_attribute("#follow", "aria-pressed") == "false"
    assert not tab.evaluate("state.follow")
    tab.click("#follow")
    for name in ("front", "side"):
        tab.click(f"#{name}")
        assert picture(tab) != seen[0]
    tab.click("#reset")
    assert picture(tab) == seen[0]


def test_the_camera_turns_moves_and_zooms(opened):
    tab = opened()
    box = tab.locator("#player").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def drag():
        before = tab.evaluate("({...camera})")
        tab.mouse.move(x, y)
        tab.mouse.down()
        tab.mouse.move(x + 50, y + 20, steps=3)
        tab.mouse.up()
        after = tab.evaluate("({...camera})")
        return {name for name in before if before[name] != after[name]}

    assert drag() == {"azimuth", "elevation"}
    tab.keyboard.down("Shift")
    assert drag() == {"x", "y"}
    tab.keyboard.up("Shift")
    tab.mouse.wheel(0, -200)
    settle(tab)
    assert tab.evaluate("camera.zoom") > 1
    assert tab.evaluate("scrollY") == 0


def rounded(text):
    """The number that is shown and half of its last digit."""
    number = text.replace(MINUS, "-").lstrip("<>")
    digits = len(number.partition(".")[2])
    return float(number), (1.0 if text[0] in "<>" else 0.5) * 10.0**-digits * 1.001


def assert_shown(text, value):
    number, most = rounded(text)
    assert number == pytest.approx(value, abs=most)


def test_the_cards_show_the_figures_of_the_document(opened, reports):
    tab, figures = opened(), reports("sample")[1]
    cards = tab.locator(".figure").all()
    values = figures["figures"]
    first = figures_at("card")
    for figure, card in zip((*first, *(one for one in FIGURES if one not in first)), cards, strict=True):
        name = f"{figure.label}, {figure.symbol}" if figure.symbol else figure.label
        assert card.locator("h3").inner_text() == name[0].upper() + name[1:]
        if values["result"][figure.key] is None:
            assert card.locator(".big").inner_text() == figure.missing.format(source="A")
            continue
        rows = dict(zip(*(card.locator(tag).all_inner_texts() for tag in ("dt", "dd")), strict=True))
        assert_shown(card.locator(".big").inner_text(), values["result"][figure.key] * figure.factor)
        assert ("copy" in rows) == (figure.key not in NOT_RUN)
        if "copy" in rows:
            assert_shown(rows["copy"], values["rotation_copy"][figure.key] * figure.factor)
        assert ("A" in rows) == figure.of_source
        if figure.of_source:
            assert_shown(rows["A"], values["source"][figure.key] * figure.factor)


def test_a_limit_says_in_words_and_by_a_mark_whether_it_is_kept(opened, reports):
    tab, limits = opened(), reports("sample")[1]["limits"]
    lines = [line for line in tab.locator(".limit").all_inner_texts() if "limit" in line]
    by_figure = {limit["figure"]: limit["over"] for limit in limits}
    first = [one.key for one in figures_at("card")]
    order = sorted(by_figure, key=lambda key: [*first, *BY_KEY].index(key))
    assert [line.split()[:2] for line in lines] == [
        ["✗", "over"] if by_figure[key] else ["✓", "within"] for key in order
    ]
    assert set(by_figure.values()) == {True, False}
    assert "✗ over limit 30" in lines
    jerk = tab.locator(".figure", has_text="Jerk")
    assert jerk.locator("dt").last.inner_text() == "B / A"
    assert_shown(jerk.locator("dd").last.inner_text(), next(one["value"] for one in limits if one["figure"] == "jerk"))


def test_figures_that_need_a_look_are_marked_in_words_and_by_colour(opened, reports):
    tab, figures = opened(), reports("sample")[1]["figures"]
    above = figures["needs_look_above"]
    for figure, card in zip(figures_at("card"), tab.locator("#figures .figure").all(), strict=True):
        value, limit = figures["result"][figure.key], above[figure.key]
        usual = [line for line in card.locator(".limit").all_inner_texts() if "limit" not in line]
        judged = limit is not None and value is not None
        assert usual[:1] == ([usual[0]] if judged else [])
        if judged:
            assert usual[0].startswith("✗ over " if value > limit else "✓ within ")
            assert ("look" in card.get_attribute("class")) == (value > limit)


def test_a_run_opens_with_its_verdict_and_lists_what_needs_a_look(opened, reports):
    tab = opened()
    assert tab.inner_text("#verdict") == reports("sample")[1]["verdict"]
    assert tab.locator("#warnings li").all_inner_texts() == ["a line", NASTY]
    assert tab.inner_text("#title") == "result clap_long_arms.bvh against source clap.bvh" == tab.title()
    assert "A, the source" in tab.inner_text("#facts")
    assert "B, the result" in tab.inner_text("#facts")
    diffed = opened("no contacts")
    assert not diffed.locator("#verdict").is_visible()
    assert not diffed.locator("#looks").is_visible()


def test_the_contact_timeline_has_a_row_per_pair_of_regions(opened):
    tab = opened()
    rows = tab.evaluate("drawing.contacts.map((row, k) => [report.contacts[k].regions, row.a.length + row.b.length])")
    assert tab.locator(".contacts .name").all_inner_texts() == [name for name, _ in rows]
    assert rows[0][0] == "left hand - right hand"
    bars = [track.locator("rect").count() for track in tab.locator(".track").all()]
    assert bars == [count for _, count in rows]


@pytest.mark.parametrize("size", [(1440, 1000), (1366, 768)])
def test_the_player_and_its_controls_are_on_the_first_screen(opened, size):
    tab = opened(width=size[0], height=size[1])
    box = tab.locator(".transport").bounding_box()
    assert box["y"] + box["height"] <= size[1]


@pytest.mark.parametrize("name", ["sample", "nasty"])
def test_nothing_is_wider_than_the_screen(opened, name):
    tab = opened(name, width=320, height=844)
    for width in (320, 390, 900, 1100):
        tab.set_viewport_size({"width": width, "height": 844})
        settle(tab)
        assert tab.evaluate("document.scrollingElement.scrollWidth") <= width
        for part in tab.locator("section:visible, .figure, .bar > *:visible").all():
            box = part.bounding_box()
            assert box["x"] + box["width"] <= width + 0.5, part.evaluate("one => one.className")


def test_on_a_phone_one_finger_turns_and_two_zoom(opened):
    tab = opened(width=390, height=844, has_touch=True)
    tab.locator("#player").scroll_into_view_if_needed()
    before = tab.evaluate("({...camera})")
    tab.evaluate("""() => {
        const send = (type, pointerId, clientX, clientY) => $('player').dispatchEvent(
            new PointerEvent(type, {pointerId, clientX, clientY, pointerType: 'touch', bubbles: true}));
        $('player').setPointerCapture = () => {};
        send('pointerdown', 7, 100, 100);
        send('pointermove', 7, 120, 100);
        send('pointerdown', 8, 200, 100);
        send('pointermove', 8, 300, 100);
        send('pointerup', 7);
        send('pointerup', 8);
    }""")
    after = tab.evaluate("({...camera})")
    assert after["azimuth"] == pytest.approx(before["azimuth"] - 20 * 0.008)
    assert after["zoom"] == pytest.approx(180 / 80)


BLANK = """canvas => {
    const {data} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    return !new Uint32Array(data.buffer).some(pixel => pixel);
}"""


def test_print_shows_every_section_on_white(opened):
    tab = opened(color_scheme="dark")
    tab.emulate_media(media="print")
    tab.evaluate("dispatchEvent(new Event('beforeprint'))")
    for section in tab.locator("main section").all():
        assert section.is_visible()
    for hidden in ("#theme", "#play", "#cell"):
        assert not tab.is_visible(hidden)
    assert tab.is_visible("#terms")
    assert not [canvas for canvas in tab.locator("canvas:visible").all() if canvas.evaluate(BLANK)]
    assert tab.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert not [what for ratio, what in tab.evaluate(CONTRASTS) if ratio < 4.5]
    tab.evaluate("dispatchEvent(new Event('afterprint'))")
    tab.emulate_media(media="screen")
    assert tab.inner_text("#theme") == "Light"
    assert not tab.is_visible("#terms")


def test_one_frame_has_nothing_to_play(opened):
    tab = opened("one frame")
    assert tab.is_disabled("#play")
    assert tab.is_disabled("#slider")
    tab.keyboard.press("Space")
    tab.keyboard.press("ArrowRight")
    assert frame(tab) == 0
    assert "only one frame" in tab.inner_text("#figures")
    assert "under four frames" in tab.inner_text("#figures")
    scrolled(tab)


def test_without_contacts_the_page_says_so(opened):
    tab = opened("no contacts")
    assert tab.inner_text("#contacts") == "No two regions of the body touch in A."
    assert "no contacts in A" in tab.inner_text("#figures")
    assert "B moves like A in every frame" in tab.inner_text("#worst")
    scrolled(tab)


def test_names_are_text(opened):
    tab = opened("nasty")
    assert tab.inner_text("#title") == f"{NASTY} against {NASTY}"
    assert tab.title() == f"{NASTY} against {NASTY}"
    assert f"1 joint of B without a counterpart in A: {NASTY}." in tab.inner_text("#notes")
    assert tab.inner_text("code") == NASTY
    assert tab.locator("b").all_inner_texts() == tab.locator(".readout b, .worst b").all_inner_texts()
    tab.evaluate("name => choose([B.points.findIndex(joint => B.names[joint] === name), 0])", f"Head{NASTY}")
    settle(tab)
    assert f"Head{NASTY}" in tab.inner_text("#selected")
    assert f"(in A: Head{BETWEEN}" in tab.inner_text("#selected")
    scrolled(tab)


def test_a_namespace_is_left_out_of_names(opened, reports):
    tab, contact = opened("namespace"), reports("namespace")[1]["contacts"][0]
    assert all(name.startswith("rig:") for name in contact["joints_b"])
    assert tab.locator("tbody th small").first.inner_text() == BETWEEN.join(contact["joints_a"])
    tab.locator("td button").first.click()
    settle(tab)
    assert tab.inner_text("#selected").startswith(f"{BETWEEN.join(contact['joints_a'])}: D in A")


def test_a_jolt_does_not_flatten_a_curve(opened, reports):
    tab, frames = opened("namespace"), reports("namespace")[1]["frames"]
    jerk = tab.locator(".curve", has_text="Jerk")
    end = jerk.locator(".axis span").first.inner_text()
    assert end.endswith("+")
    worst = max(range(197), key=lambda k: frames[k]["jerk"])
    assert 2 * float(end[:-1]) < frames[worst]["jerk"]
    tab.fill("#slider", str(worst))
    settle(tab)
    assert_shown(jerk.locator(".readout b").last.inner_text(), frames[worst]["jerk"])
    assert "+" not in tab.locator(".curve", has_text="Direction").locator(".axis").inner_text()


def test_of_a_long_clip_every_frame_can_be_gone_to(opened, reports, monkeypatch):
    monkeypatch.setattr("distretarget.report.page.BUDGET", 50_000)
    tab, figures = opened("thinned"), reports("thinned")[1]
    step = tab.evaluate("drawing.step")
    assert step > 1
    assert f"one frame in {step}" in tab.inner_text("#notes")
    tab.keyboard.press("End")
    assert frame(tab) == figures["frame_count"] - 1
    assert tab.evaluate("A.placed") == (figures["frame_count"] - 1) // step > 10
    before = picture(tab)
    tab.keyboard.press("Home")
    assert picture(tab) != before
    tab.keyboard.press("ArrowRight")
    assert frame(tab) == 1
    stress = tab.locator(".curve", has_text="Stress").locator(".readout")
    assert_shown(stress.inner_text(), 1000 * figures["frames"][1]["stress"])


def test_every_control_has_a_name(opened):
    tab = opened()
    controls = tab.locator("button, input, select, summary, a[href], [tabindex='0']").all()
    assert len(controls) > 40
    snapshot = tab.locator("body").aria_snapshot()
    for control in controls:
        named = control.get_attribute("aria-label") or control.inner_text().strip()
        assert named, control.evaluate("one => one.outerHTML.slice(0, 120)")
    assert not re.search(r"- (button|slider|combobox|link)\s*$", snapshot, re.MULTILINE)
    assert 'combobox "Speed"' in snapshot


@pytest.mark.parametrize("theme", THEMES)
def test_text_can_be_read(opened, theme):
    found = opened(color_scheme=theme).evaluate(CONTRASTS)
    assert len(found) > 150
    assert not [(ratio, what) for ratio, what in found if ratio < 4.5]


@pytest.mark.parametrize("theme", THEMES)
def test_marks_can_be_seen(opened, theme):
    """Bones, curves and contacts against the panel they are drawn on."""
    tab = opened(color_scheme=theme)
    names = ["a", "b", "e0", "e1", "e2", "e3", "touch", "mark", "stance"]
    tab.evaluate(
        "names => $('legend').append(...names.map(n => element('i', {style: `color: var(--${n})`}, n)))", names
    )
    found = [(ratio, what) for ratio, what in tab.evaluate(CONTRASTS) if what.startswith("<i style")]
    assert len(found) == len(names)
    assert not [what for ratio, what in found if ratio < 3]
