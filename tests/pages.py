"""Helpers for tests of pages, as text and in a browser."""

import hashlib
import json
import re
from base64 import b64encode
from contextlib import contextmanager

PATIENCE = 120_000  # the longest wait for a page, of a busy machine [ms]

# A script: the contrast to its background of each text on a page, as WCAG 2 defines it, with the element's HTML.
CONTRASTS = """() => {
    const linear = part => part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4;
    const parts = colour => (colour.match(/[\\d.]+/g) || []).map(Number);
    const luminance = colour => {
        const [r, g, b] = parts(colour).map(part => linear(part / 255));
        return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    };
    const background = one => {
        for (; one; one = one.parentElement) {
            const colour = getComputedStyle(one).backgroundColor;
            if (parts(colour)[3] !== 0) return colour;
        }
        return 'rgb(255, 255, 255)';
    };
    const texts = [...document.querySelectorAll('body *:not(script)')].filter(one => one.checkVisibility()
        && [...one.childNodes].some(node => node.nodeType === Node.TEXT_NODE && node.data.trim()));
    return texts.map(one => {
        const [p, q] = [luminance(getComputedStyle(one).color), luminance(background(one))];
        return [(Math.max(p, q) + 0.05) / (Math.min(p, q) + 0.05), one.outerHTML.slice(0, 160)];
    });
}"""


def embedded(text, name):
    """The JSON of a script element, which ends where a browser ends it: at the first `</script`."""
    start = text.index(f'<script type="application/json" id="{name}">')
    return json.loads(text[text.index(">", start) + 1 : text.index("</script", start)])


def check_it_asks_for_nothing(text):
    """That a page is one file that runs only its own scripts, and that those after the library make no markup of text;
    return these.
    """
    assert not re.search(r'(src|href)="(?!#|data:)|@import|url\(|\{\{', text)
    assert "default-src 'none'" in text
    assert '<meta name="generator" content="distretarget">' in text
    scripts = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    hashes = [b64encode(hashlib.sha256(one.encode()).digest()).decode() for one in scripts]
    assert re.findall(r"script-src (.*?);", text) == [" ".join(f"'sha256-{each}'" for each in hashes)]
    unsafe = r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|eval\(|Function\(|fetch\("
    assert not re.search(unsafe, scripts[-1])
    return scripts


def check_text_can_be_read(tab):
    found = tab.evaluate(CONTRASTS)
    assert len(found) > 100
    assert not [(ratio, what) for ratio, what in found if ratio < 4.5]


def made_once(folder, make):
    """A function that makes the page of a name in a folder, once, and returns its file; `make` returns its text."""

    def page(name):
        path = folder / f"{name}.html"
        if not path.exists():
            path.write_text(make(name), "utf-8")
        return path

    return page


@contextmanager
def printed(tab):
    """A page in its dark theme while it is printed: on white, with the terms, and as before at the end."""
    tab.emulate_media(media="print")
    tab.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert tab.is_visible("#terms")
    assert tab.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    yield
    tab.evaluate("dispatchEvent(new Event('afterprint'))")
    tab.emulate_media(media="screen")
    assert tab.inner_text("#theme") == "Light"
    assert not tab.is_visible("#terms")


def settle(tab):
    """Wait until pending changes of the page have been laid out and drawn."""
    tab.evaluate("async () => { for (let k = 0; k < 3; k++) await new Promise(requestAnimationFrame); }")


def wait_until_true(tab, expression):
    """Wait until an expression is true in a page, for at most `PATIENCE`, as events reach a page at no fixed time."""
    for _ in range(PATIENCE // 50):
        if tab.evaluate(expression):
            return
        tab.wait_for_timeout(50)
    raise AssertionError(f"after {PATIENCE / 1000} s not true: {expression}")
