"""Measure size and speed of the report of a diff: of a sample, and of a clip of 5,000 frames on bodies of 60 joints.

    python benchmarks/report.py [--frames 5000] [--joints 60] [--browser /usr/bin/chromium]

The long clip is the sample, played forwards and backwards, on bodies with added helper joints. Prints per report: its
size in MB, seconds from opening to the first drawing, and drawings per second while it plays at 1x, side by side and
overlaid, in a window of 1440 x 1000 pixels. The exit status is 1 if a report is over 8 MB or 2 s, or under 30 drawings
a second. Needs the extra `test` and Chromium or Chrome, which runs headless and without a graphics card.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

import click
import numpy as np
from clips import SAMPLES, back_and_forth
from edits import TARGETS, edited
from playwright.sync_api import sync_playwright
from skeleton_edits import on_skeleton, with_chain

from distretarget import Motion, diff, read_bvh, retarget
from distretarget.report.clip_page import diff_page
from distretarget.report.diff_document import About, document

SAMPLE = SAMPLES / "clap.bvh"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
SIZE = {"width": 1440, "height": 1000}  # of the window [pixels]
LIMITS = (8.0, 2.0, 30.0)  # largest size [MB], longest time to the first drawing [s], fewest drawings per second
PLAYING = 5.0  # for how long drawings are counted [s]
# A script that notes when the frame number beside the slider first appears, at the end of a drawing [ms from opening].
WATCH = """window.drawn = new Promise(done => {
    const look = () => {
        if (document.getElementById('now')?.textContent) done(performance.now());
        else requestAnimationFrame(look);
    };
    look();
});"""
# A script that plays for some seconds, and returns drawings per second.
PLAY = """async seconds => {
    setPlaying(true);
    await new Promise(done => setTimeout(done, 500));
    const [count, start] = [state.draws, performance.now()];
    await new Promise(done => setTimeout(done, 1000 * seconds));
    const rate = 1000 * (state.draws - count) / (performance.now() - start);
    setPlaying(false);
    return rate;
}"""


def with_helpers(motion: Motion, joints: int) -> Motion:
    """The motion on a body with this many joints, not counting End Sites; helper joints are added below its own."""
    body = motion.skeleton
    hosts = np.flatnonzero(~body.end_sites)
    offset = np.full(3, 0.02 * body.offsets[1:].std())
    for k in range(joints - len(hosts)):
        body = with_chain(body, int(hosts[k % len(hosts)]), {f"Helper{k}": offset})
    return on_skeleton(motion, body)


def measure(name: str, a: Motion, b: Motion, browser: str) -> bool:
    """Measure the diff report of two motions in a new browser, print the line, and return whether it misses a limit."""
    difference = diff(a, b)
    text = diff_page(difference, document(difference, About(a="a.bvh", b="b.bvh", command="", version="")))
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        path = Path(folder) / "report.html"
        path.write_text(text, encoding="utf-8")
        program = playwright.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        tab = program.new_page(viewport=SIZE)
        tab.add_init_script(WATCH)
        tab.goto(path.as_uri())
        opening = tab.evaluate("drawn") / 1000
        beside = float(tab.evaluate(PLAY, PLAYING))
        tab.click("#overlaid")
        overlaid = float(tab.evaluate(PLAY, PLAYING))
        program.close()
    size = len(text.encode()) / 1e6
    missed = size > LIMITS[0] or opening > LIMITS[1] or min(beside, overlaid) < LIMITS[2]
    print(
        f"{name:<34} {size:6.2f} MB   first drawing {opening:5.2f} s   "
        f"drawings/s {beside:5.1f} side by side, {overlaid:5.1f} overlaid{'   MISSED' * missed}",
        flush=True,
    )
    return missed


@click.command(help=__doc__)
@click.option("--frames", default=5000, show_default=True)
@click.option("--joints", default=60, show_default=True)
@click.option("--browser", default=next(filter(None, map(shutil.which, BROWSERS)), None))
def main(frames: int, joints: int, browser: str | None) -> None:
    """Print a line per report; exit with 1 if one misses a limit."""
    if not browser:
        raise click.UsageError("found no Chromium or Chrome; give its path with --browser")
    a = read_bvh(SAMPLE)
    b = retarget(a, edited(a.rigid_skeleton, TARGETS["forearm and hand +50 %"])).motion
    long = [back_and_forth(with_helpers(motion, joints), frames) for motion in (a, b)]
    missed = []
    for name, pair in ((f"{SAMPLE.name}, {len(a)} frames", (a, b)), (f"{len(long[0])} frames", long)):
        missed.append(measure(f"{name}, {len(pair[0].skeleton.joints)} joints", *pair, browser))
    sys.exit(any(missed))


if __name__ == "__main__":
    main()
