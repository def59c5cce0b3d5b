"""Fixtures that several test files share."""

import json
import shutil

import pytest
from bodies import other_lengths, person, swaying
from hypothesis import settings
from pages import settle

from distretarget import write_bvh
from distretarget.errors import LibraryError
from distretarget.io.skeleton_json import skeleton_to_json
from distretarget.numerics.compiled import loaded

settings.register_profile("however slow", deadline=None)  # a busy machine is no fault of the program
settings.load_profile("however slow")

PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "chrome")
PLAYER_BUILT = "async () => { while (!globalThis.app) await new Promise(requestAnimationFrame); }"
SOFTWARE = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")  # draws WebGL without a graphics card


def pytest_configure():
    """End at once where the compiled functions are not those of the sources."""
    try:
        loaded()
    except LibraryError as error:
        pytest.exit(str(error), returncode=1)


@pytest.fixture(scope="module")
def browser():
    """A browser; tests that need one are skipped where there is none."""
    reason = "playwright, which drives the browser, is not installed"
    sync_api = pytest.importorskip("playwright.sync_api", reason=reason)
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if not program:
        pytest.skip("no Chromium or Chrome is installed")
    with sync_api.sync_playwright() as playwright:
        running = playwright.chromium.launch(
            executable_path=program, args=["--no-sandbox", "--disable-background-networking", *SOFTWARE]
        )
        yield running
        running.close()


@pytest.fixture
def open_page(browser):
    """Opens a file in a tab; at the end no page has asked for anything else, or complained on the console."""
    tabs, problems, asked = [], [], []

    def opens(path, width=1440, height=1000, **context):
        tab = browser.new_page(viewport={"width": width, "height": height}, **context)
        tabs.append(tab)
        tab.on("console", lambda message: problems.append(message.text))
        tab.on("pageerror", lambda error: problems.append(str(error)))
        tab.on("request", lambda request: asked.append(request.url))
        tab.goto(path.as_uri())
        settle(tab)
        return tab

    yield opens
    for tab in tabs:
        settle(tab)
        tab.close()
    assert not problems
    assert len(asked) == len(tabs)
    assert all(url.startswith("file:") for url in asked)


@pytest.fixture
def open_player(open_page):
    """Opens a page with a player, and waits until that is built."""

    def opens(path, **options):
        tab = open_page(path, **options)
        tab.evaluate(PLAYER_BUILT)
        settle(tab)
        return tab

    return opens


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working folder, with a clip, `in.bvh`, and a target, `body.json`."""
    monkeypatch.chdir(tmp_path)
    write_bvh(tmp_path / "in.bvh", swaying(person()))
    (tmp_path / "body.json").write_text(skeleton_to_json(other_lengths(person()), "body"))
    return tmp_path


@pytest.fixture
def written(tmp_path):
    """Write a document, or text, to a file."""

    def write(document):
        path = tmp_path / "target.json"
        text = document if isinstance(document, str) else json.dumps(document)
        path.write_text(text, encoding="utf-8", errors="surrogateescape")
        return path

    return write
