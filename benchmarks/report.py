"""Measure size and speed of the report of a diff: of a sample, and of a clip of 5,000 frames on bodies of 60 joints.

    python benchmarks/report.py [--frames 5000] [--joints 60] [--browser /usr/bin/chromium]

The long clip is the sample, played forwards and backwards, on bodies with added helper joints. Prints per report: its
size in MB, seconds from opening to the first drawing, and drawings per second while it plays at 1x, side by side and
overlaid, in a window of 1440 x 1000 pixels. The exit status is 1 if a report is over 8 MB or 2 s, or under 30 drawings
a second. Needs the extra `test` and Chromium or Chrome, which runs headless and without a graphics card.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from clips import SAMPLES, back_and_forth
from edits import TARGETS, edited
from playwright.sync_api import Page, sync_playwright

from distretarget import Motion, Skeleton, read_bvh, retarget
from distretarget.measure.diff import diff
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


@dataclass(frozen=True, kw_only=True)
class Measured:
    """One report: its size [MB], seconds to the first drawing, drawings per second side by side and overlaid."""

    name: str
    size: float
    opening: float
    beside: float
    overlaid: float

    @property
    def failed(self) -> bool:
        """Whether it misses a limit."""
        return self.size > LIMITS[0] or self.opening > LIMITS[1] or min(self.beside, self.overlaid) < LIMITS[2]

    @property
    def line(self) -> str:
        """The line to print."""
        return (
            f"{self.name:<34} {self.size:6.2f} MB   first drawing {self.opening:5.2f} s   "
            f"drawings/s {self.beside:5.1f} side by side, {self.overlaid:5.1f} overlaid{'   MISSED' * self.failed}"
        )


def with_helpers(motion: Motion, joints: int) -> Motion:
    """The motion on a body with this many joints, not counting End Sites; each added joint is a child of an old one."""
    body = motion.skeleton
    ends = int(body.end_sites.sum())
    added = np.arange(max(0, joints + ends - len(body)))
    hosts = np.flatnonzero(~body.end_sites)[added % (len(body) - ends)]
    offsets = np.tile(0.02 * body.offsets[1:].std(), (len(added), 3))
    skeleton = Skeleton(
        names=body.names + tuple(f"Helper{k}" for k in added),
        parents=np.concatenate([body.parents, hosts]),
        offsets=np.concatenate([body.offsets, offsets]),
        channels=body.channels + (("Zrotation", "Xrotation", "Yrotation"),) * len(added),
        end_sites=np.concatenate([body.end_sites, np.zeros(len(added), bool)]),
    )
    still = np.broadcast_to([0.0, 0, 0, 1], (len(motion), len(added), 4))
    return replace(motion, skeleton=skeleton, rotations=np.concatenate([motion.rotations, still], axis=1))


def html(a: Motion, b: Motion) -> str:
    """The report of the diff of two motions."""
    difference = diff(a, b)
    return diff_page(difference, document(difference, About(a="a.bvh", b="b.bvh", command="", version="")))


def drawings(tab: Page) -> float:
    """Drawings per second while it plays."""
    script = """async seconds => {
        setPlaying(true);
        await new Promise(done => setTimeout(done, 500));
        const [count, start] = [state.draws, performance.now()];
        await new Promise(done => setTimeout(done, 1000 * seconds));
        const rate = 1000 * (state.draws - count) / (performance.now() - start);
        setPlaying(false);
        return rate;
    }"""
    return float(tab.evaluate(script, PLAYING))


def measure(name: str, text: str, browser: str) -> Measured:
    """Open a report in a new browser and measure it."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        path = Path(folder) / "report.html"
        path.write_text(text, encoding="utf-8")
        program = playwright.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        tab = program.new_page(viewport=SIZE)
        tab.add_init_script(WATCH)
        tab.goto(path.as_uri())
        opening = tab.evaluate("drawn") / 1000
        beside = drawings(tab)
        tab.click("#overlaid")
        measured = Measured(
            name=name, size=len(text.encode()) / 1e6, opening=opening, beside=beside, overlaid=drawings(tab)
        )
        program.close()
    return measured


def main() -> int:
    """Print a line per report; return 1 if one misses a limit."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=5000)
    parser.add_argument("--joints", type=int, default=60)
    parser.add_argument("--browser", default=next(filter(None, map(shutil.which, BROWSERS)), None))
    arguments = parser.parse_args()
    if not arguments.browser:
        parser.error("found no Chromium or Chrome; give its path with --browser")
    a = read_bvh(SAMPLE)
    b = retarget(a, edited(a.rigid_skeleton, TARGETS["forearm and hand +50 %"])).motion
    long = [back_and_forth(with_helpers(motion, arguments.joints), arguments.frames) for motion in (a, b)]
    failed = False
    for name, pair in ((f"{SAMPLE.name}, {len(a)} frames", (a, b)), (f"{len(long[0])} frames", long)):
        joints = int((~pair[0].skeleton.end_sites).sum())
        measured = measure(f"{name}, {joints} joints", html(*pair), arguments.browser)
        print(measured.line, flush=True)
        failed |= measured.failed
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
