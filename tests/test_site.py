"""The site is built without warnings, and a browser shows its pages, wide and narrow, without complaints."""

import subprocess
import sys
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest
from bodies import ROOT

WIDTHS = (1360, 390)  # of a desktop and of a phone [px]


class QuietHandler(SimpleHTTPRequestHandler):
    """Serves files without a log."""

    def log_message(self, *_arguments):
        pass


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the site."""
    for package in ("material", "mkdocstrings", "math_core"):
        pytest.importorskip(package, reason="the extra `docs` is not installed")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    return folder


@pytest.fixture(scope="module")
def address(site):
    """The address of a server for the site."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(QuietHandler, directory=str(site))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.mark.parametrize("width", WIDTHS)
def test_pages_show_without_complaints_and_load_nothing_from_elsewhere(site, address, browser, width):
    tab, problems, asked = browser.new_page(viewport={"width": width, "height": 900}), [], []
    tab.on("console", lambda message: problems.append(message.text))
    tab.on("pageerror", lambda error: problems.append(str(error)))
    tab.on("request", lambda request: asked.append(request.url))
    for page in sorted(site.glob("*.html")):
        tab.goto(f"{address}/{page.name}", wait_until="load")
        assert tab.evaluate("document.documentElement.scrollWidth") <= width, page.name
        assert tab.evaluate("[...document.images].every(each => each.loading == 'lazy' || each.naturalWidth)"), (
            page.name
        )
    tab.close()
    assert not problems
    assert all(url.startswith((address, "data:", "blob:")) for url in asked)


def test_formulas_are_drawn_by_the_browser_itself(site):
    text = (site / "method.html").read_text("utf-8")
    assert text.count("<math") > 100
    assert "$$" not in text
