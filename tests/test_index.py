"""The page over clips: its content, and its size; and in a browser, where it sorts, filters, and links to reports."""

import html
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bodies import person, swaying
from pages import (
    check_it_asks_for_nothing,
    check_text_can_be_read,
    embedded,
    made_once,
    printed,
    settle,
    wait_until_true,
)

import distretarget.report
from distretarget.batch.pages import FIELDS, METRIC_COLUMNS, index_page
from distretarget.measure.metrics import COLUMNS
from distretarget.report.page import VERSION
from distretarget.report.stage import shown_actor, stage_of
from distretarget.target import Target

NASTY = "</script><!--<b>&amp; \"q' ü \u2028\u2029 \ud800 {{batch}}"


def metrics(value=0.123456789):
    return dict.fromkeys(COLUMNS, value)


def record(name="a.bvh", **others):
    """The record of a clip, as far as the page reads it."""
    return {
        "input": f"/clips/{name}",
        "output": name,
        "target": "/rigs/tall.json",
        "frames": 10,
        "seconds": 0.5,
        "metrics": metrics(),
        "warnings": [],
        "status": "done",
        "error": "",
        **others,
    }


def failed(name="bad.bvh", error="no reason", **others):
    return record(name, frames=0, seconds=0.0, metrics={}, status="failed", error=error, **others)


def batch_of(*records, links=None):
    """What the page has of some clips."""
    return embedded(index_page(records, links or {}, "title", {}), "batch")


def rows_of(*records, links=None):
    batch = batch_of(*records, links=links)
    assert tuple(batch["fields"]) == FIELDS
    return [dict(zip(FIELDS, row, strict=True)) for row in batch["rows"]]


def test_names_of_all_kinds_stay_text():
    one = failed(NASTY, NASTY, target=NASTY, warnings=[NASTY])
    text = index_page([one], {NASTY: NASTY}, NASTY, {})
    assert text.encode("utf-8")
    plain = index_page([failed()], {}, "title", {})
    for mark in ("<script", "</script", "<!--", "<b>"):
        assert text.count(mark) == plain.count(mark)
    batch = embedded(text, "batch")
    (row,) = batch["rows"]
    assert one["input"].endswith(batch["folder"] + row[FIELDS.index("clip")])
    assert batch["warnings"] == [NASTY]
    assert row[FIELDS.index("error")] == NASTY
    assert html.escape(NASTY.replace("\ud800", "\ufffd")) in text


@pytest.mark.parametrize(
    ("path", "url"),
    [
        ("a/b c.html", "a/b%20c.html"),
        ("javascript:alert(1)", "javascript%3Aalert%281%29"),
        ("50%#?.html", "50%25%23%3F.html"),
        ("ü\"'<>.html", "%C3%BC%22%27%3C%3E.html"),
        ("\udcff.html", "%FF.html"),
        ("\ud800.html", "%ED%A0%80.html"),
    ],
)
def test_links_are_quoted(path, url):
    with_link, without = rows_of(record("a.bvh"), record("b.bvh"), links={"a.bvh": path})
    assert with_link["link"] == url
    assert without["link"] is None


def test_the_page_is_one_file_that_asks_for_nothing():
    text = index_page([record(), failed()], {"a.bvh": "a.html"}, "title", {})
    assert not re.search(r"https?:", text)
    assert len(check_it_asks_for_nothing(text)) == 1  # without clips to play, no library


def test_a_failed_clip_has_a_reason_and_no_numbers():
    (row,) = rows_of(failed(error="there is nothing to retarget"))
    assert row["done"] == 0
    assert row["error"] == "there is nothing to retarget"
    assert all(row[name] is None for name in ("frames", "seconds", *METRIC_COLUMNS))


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        ("/clips/bad.bvh:7: found 'nan'", "line 7: found 'nan'"),
        ("/clips/bad.bvh: no frames", "no frames"),
        ("/clips/bad.bvh: /rigs/tall.json: no match", "no match"),
        ("/rigs/tall.json: no match", "no match"),
        ("/clips/bad.bvh.gz: no frames", "/clips/bad.bvh.gz: no frames"),
        ("", "no reason given"),
    ],
)
def test_a_reason_leaves_out_what_stands_beside_it(error, reason):
    assert rows_of(failed(error=error))[0]["error"] == reason


def test_metrics_that_are_missing_or_no_numbers_are_none():
    (row,) = rows_of(record(metrics={**metrics(), "jerk": float("nan"), "pop": None}))
    missing = {"jerk", "pop"}
    assert {name for name in METRIC_COLUMNS if row[name] is None} == missing
    assert row["contact_error"] == 0.123457


def test_names_leave_out_the_folder_they_share():
    batch = batch_of(record("x/a.bvh"), record("x/ab.bvh", target="/rigs/t.json"))
    assert batch["folder"] == "x/"
    assert [row[0] for row in batch["rows"]] == ["a.bvh", "ab.bvh"]
    assert batch["targets"] == ["tall.json", "t.json"]
    windows = batch_of(*(record(input=rf"C:\clips\{name}") for name in "ab"))
    assert windows["folder"] == "clips\\"


def test_a_clip_takes_few_bytes():
    def size(count):
        names = [f"folder/clip_{k:05}.bvh" for k in range(count)]
        records = [record(name, warnings=["w" * 300], input=f"/{'long/' * 30}{name}", version="1") for name in names]
        return len(index_page(records, {name: f"{name}.html" for name in names}, "title", {}).encode())

    assert (size(1100) - size(100)) / 1000 < 300


def test_the_script_reads_fields_that_the_page_has():
    script = Path(distretarget.report.__file__).with_name("index.js").read_text("utf-8")
    assert set(re.findall(r"clip\.(\w+)", script)) <= {*FIELDS, "clip"}


MARKUP = "</script><b>&amp; \"q' ü"
LONG = "x" * 300
TARGETS = ("/rigs/tall.json", "/rigs/short.json")
NONE = "\u2013"
CONTACT = "Contact error"


def clip(k, contact, **others):
    """A record of a done clip with this contact error; the copy's is larger by 0.1."""
    values = metrics(0.5)
    values["contact_error"], values["contact_error_copy"] = contact, contact + 0.1
    return record(f"clip_{k}.bvh", **{"metrics": values, "frames": 100 + k, "target": TARGETS[k % 2], **others})


def few():
    """Clips with contact errors of 0.1, 0.3, 0.2 and none, the second with warnings; one that failed."""
    clips = [clip(0, 0.1), clip(1, 0.3, warnings=["one", MARKUP]), clip(2, 0.2), clip(10, 0.0)]
    clips[3]["metrics"]["contact_error"] = None
    return [failed("bad.bvh", "/clips/bad.bvh:7: found 'nan'", target=TARGETS[0]), *clips]


def nasty():
    return [
        record(MARKUP, target=MARKUP, warnings=[LONG]),
        failed(f"{MARKUP}2", MARKUP),
        failed(LONG, LONG, target=f"/{LONG}"),
        record(f"{LONG}2", target=f"/{LONG}2"),
    ]


def many():
    errors = np.random.default_rng(0).permutation(10_000) / 1e4
    done = [clip(k, error, warnings=["one"]) for k, error in enumerate(errors.tolist())]
    return [failed(f"bad_{k}.bvh") if k % 100 == 50 else one for k, one in enumerate(done)]


def stages():
    """What the player shows of the second and the third clip, one with a name like no other."""
    a, b = swaying(person(), 8, seed=1), swaying(person(), 5, seed=2)
    made = {}
    for number, (output, motion) in enumerate({"clip_1.bvh": a, "clip_2.bvh": b}.items()):
        actors = [
            replace(shown_actor(MARKUP, side, Target(motion.skeleton, {}, ""), motion), name=f"{MARKUP}{number}")
            for side in (0, 1)
        ]
        made[output] = stage_of(actors)
    return made


MADE = {
    "few": few,
    "some": lambda: many()[:60],
    "one target": lambda: [clip(0, 0.1)],
    "played": few,
    "empty": list,
    "nasty": nasty,
    "many": many,
}


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """Makes a page once: its file."""

    def text(name):
        records = MADE[name]()
        links = {one["output"]: f"reports/{one['output']}.html" for one in records if one["status"] == "done"}
        return index_page(records, links, f"Title {name}", stages() if name == "played" else {})

    return made_once(tmp_path_factory.mktemp("pages"), text)


@pytest.fixture
def opened(open_page, pages):
    """Opens a page in a tab."""
    return lambda name="few", **options: open_page(pages(name), **options)


def names(tab):
    return tab.locator("tbody th").all_inner_texts()


def column(tab, name):
    """The cells of a column of metrics, of clips that are done."""
    heads = [text.split("\n")[0].rstrip(" ▲▼") for text in tab.locator("thead th").all_inner_texts()]
    rows = tab.evaluate("[...$('rows').rows].map(row => [...row.cells].map(cell => cell.firstChild?.data))")
    return [row[heads.index(name)] for row in rows if len(row) == len(heads)]


def head(tab, name):
    return tab.locator("thead th", has_text=re.compile(f"^{name}"))


def test_the_page_has_counts_cards_links_and_named_controls(opened):
    tab = opened()
    facts = dict(zip(*(tab.locator(f"#facts {tag}").all_inner_texts() for tag in ("dt", "dd")), strict=True))
    assert facts == {
        "Clips": "5",
        "Converted": "4",
        "Failed": "1",
        "Frames": "413",
        "Retargeting": "2.00 s, all clips added up",
        "Folder": "clips/",
        "Made by": f"distretarget version {VERSION}",
    }
    assert tab.title() == tab.inner_text("h1") == "Title few"
    assert "tall.json" in opened("one target").inner_text("#facts")
    card = tab.locator(".metric").first
    assert card.locator(".big").inner_text() == "0.200 median"
    rows = dict(zip(*(card.locator(tag).all_inner_texts() for tag in ("dt", "dd")), strict=True))
    assert rows == {"worst": "0.300", "rotation copy": "0.250", "copy’s worst": "0.400"}  # noqa: RUF001
    links = {link.inner_text(): link.get_attribute("href") for link in tab.locator("tbody a").all()}
    assert links == {f"clip_{k}.bvh": f"reports/clip_{k}.bvh.html" for k in (0, 1, 2, 10)}
    for control in tab.locator("button, input, select, summary, a[href], [tabindex='0']").all():
        assert control.get_attribute("aria-label") or control.inner_text().strip()


def test_failures_are_shown_with_their_reasons(opened):
    tab = opened()
    tab.click("#facts button")
    assert names(tab) == ["bad.bvh"]
    assert tab.locator("tbody .reason").all_inner_texts() == ["line 7: found 'nan'"]
    assert not opened("one target").locator("#facts button").count()


def test_the_worst_contact_error_comes_first_and_what_is_missing_last(opened):
    tab = opened()
    assert column(tab, CONTACT) == ["0.300", "0.200", "0.100", NONE]
    assert head(tab, CONTACT).get_attribute("aria-sort") == "descending"
    head(tab, CONTACT).locator("button").focus()
    tab.keyboard.press("Enter")
    assert column(tab, CONTACT) == ["0.100", "0.200", "0.300", NONE]
    assert head(tab, CONTACT).get_attribute("aria-sort") == "ascending"
    assert set(names(tab)[3:]) == {"bad.bvh", "clip_10.bvh"}


def test_every_column_sorts_both_ways(opened):
    tab = opened()
    clips = ["bad.bvh", "clip_0.bvh", "clip_1.bvh", "clip_2.bvh", "clip_10.bvh"]
    for button in tab.locator("thead button").all():
        button.evaluate("one => one.click()")
        first = names(tab)
        button.evaluate("one => one.click()")
        assert sorted(first) == sorted(names(tab)) == sorted(clips)
    assert tab.locator("[aria-sort]").count() == 1
    head(tab, "Clip").locator("button").click()
    assert names(tab) == clips
    head(tab, "Clip").locator("button").click()
    assert names(tab) == clips[::-1]
    head(tab, "Frames").locator("button").click()
    assert column(tab, "Frames") == ["110", "102", "101", "100"]
    assert names(tab)[-1] == "bad.bvh"


def test_filters_choose_clips(opened):
    tab = opened()
    for text, found in (("CLIP_1", ["clip_1.bvh", "clip_10.bvh"]), ("nan", ["bad.bvh"]), ("short", ["clip_1.bvh"])):
        tab.fill("#filter", text)
        assert names(tab) == found
    tab.fill("#filter", "nothing has this")
    assert tab.inner_text("tbody") == "No clip passes the filters."
    assert tab.inner_text("#count") == "0 clips, 5 in all"
    tab.fill("#filter", "")
    for status, count in (("failed", 1), ("converted", 4), ("warned", 1), ("all", 5)):
        tab.select_option("#status", status)
        assert len(names(tab)) == count


def test_warnings_open_and_close(opened):
    tab = opened()
    button = tab.locator("td button")
    assert button.get_attribute("aria-label") == "2 warnings of clip_1.bvh"
    button.click()
    assert tab.locator(".told li").all_inner_texts() == ["one", MARKUP]
    assert button.get_attribute("aria-expanded") == "true"
    button.click()
    assert tab.locator(".told").count() == 0


def test_the_theme_can_be_switched(opened):
    tab = opened(color_scheme="light")
    seen = []
    for label in ("Dark", "Light", "Dark"):
        assert tab.inner_text("#theme") == label
        seen.append(tab.evaluate("getComputedStyle(document.body).backgroundColor"))
        tab.click("#theme")
    assert seen[0] == seen[2] != seen[1]


@pytest.mark.parametrize("name", ["few", "nasty"])
def test_nothing_is_wider_than_the_screen(opened, name):
    tab = opened(name)
    for width in (1440, 1251, 900, 390, 320):
        tab.set_viewport_size({"width": width, "height": 844})
        settle(tab)
        assert tab.evaluate("document.scrollingElement.scrollWidth") <= width
        for cell in tab.locator("tbody th, tbody td").all() if width < 640 else []:
            assert cell.bounding_box()["x"] + cell.bounding_box()["width"] <= width


def test_the_head_of_a_table_that_is_scrolled_stays_on_the_screen(opened):
    tab = opened("some")
    top = "document.querySelector('.scrolled').getBoundingClientRect().top"
    tab.evaluate("document.querySelector('.scrolled').scrollTo(0, 300)")
    assert head(tab, "Clip").bounding_box()["y"] == pytest.approx(tab.evaluate(top), abs=1)
    assert tab.locator("tbody tr").first.bounding_box()["y"] < 0.9 * tab.evaluate(top)


def test_names_are_text(opened):
    tab = opened("nasty")
    assert MARKUP in names(tab)
    assert not tab.locator("b").count()
    assert MARKUP in tab.locator(".reason").all_inner_texts()
    tab.locator(".reason summary").click()
    assert tab.locator("details.reason").get_attribute("open") is not None


def test_an_empty_page_says_so(opened):
    tab = opened("empty")
    assert tab.inner_text("tbody") == "There are no clips."
    assert not tab.is_visible("#metrics")


def test_of_ten_thousand_clips_five_hundred_are_shown_at_a_time(opened):
    tab = opened("many")
    rows = tab.locator("tbody tr")
    assert rows.count() == 500
    assert tab.inner_text("#count") == "first 500 of 10,000 clips"
    tab.click("#more")
    assert rows.count() == 1000
    shown = [float(text) for text in column(tab, CONTACT)]
    assert shown == sorted(shown, reverse=True)
    tab.click("#facts button")
    assert rows.count() == 100
    assert not tab.is_visible("#more")
    assert tab.inner_text("#count") == "100 clips, 10,000 in all"


def test_print_shows_table_and_terms_on_white(opened):
    tab = opened(color_scheme="dark")
    with printed(tab):
        assert tab.is_visible("tbody")
        assert not tab.is_visible("#filter")


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_text_can_be_read(opened, theme):
    check_text_can_be_read(opened(color_scheme=theme))


@pytest.mark.parametrize(("width", "theme"), [(1360, "light"), (390, "dark")])
def test_clips_are_played(open_player, pages, width, theme):
    tab = open_player(pages("played"), width=width, height=844, color_scheme=theme)
    assert tab.inner_text("#watched-name") == "clip_1.bvh"
    assert tab.evaluate("app.clock.count") == 8
    assert tab.locator("#labels > div").all_inner_texts() == [f"{MARKUP}0"] * 2
    buttons = tab.locator(".watch")
    assert [one.get_attribute("aria-pressed") for one in buttons.all()] == ["true", "false"]
    tab.keyboard.press("End")
    buttons.nth(1).click()
    wait_until_true(tab, "globalThis.app?.clock.count === 5")
    settle(tab)
    assert tab.inner_text("#watched-name") == "clip_2.bvh"
    assert tab.evaluate("[app.clock.count, app.clock.frame]") == [5, 0]
    assert [one.get_attribute("aria-pressed") for one in buttons.all()] == ["false", "true"]
    tab.keyboard.press("ArrowRight")
    assert tab.evaluate("app.clock.frame") == 1
    settle(tab)
    assert tab.inner_text("#now").startswith("1 / 4")
    assert tab.evaluate("document.scrollingElement.scrollWidth") <= width
    head(tab, "Clip").locator("button").click()
    assert tab.locator(".watch[aria-pressed=true]").get_attribute("aria-label") == "Play clip_2.bvh"
