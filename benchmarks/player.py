"""The player in headless Chromium with its software renderer, at 900 x 700: frames per second, and how long it takes to
the first picture; and the sizes of pages.

    python benchmarks/player.py [CHARACTER.glb]

Needs playwright and Chromium. CHARACTER is another mesh to measure than a body of 30,000 triangles.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from playwright.sync_api import Browser, sync_playwright

from distretarget import Motion, Skeleton, Target, load_target, read_bvh, retarget
from distretarget.body.body import Body
from distretarget.measure.diff import diff
from distretarget.report.clip_page import diff_page
from distretarget.report.diff_document import About, document
from distretarget.report.stage import shown_actor, view_page
from distretarget.skin.mesh import SkinnedMesh

SAMPLES = Path(__file__).parents[1] / "sample_bvh"
FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
SECONDS = 4.0
DRAWN = """async () => {
    while (!globalThis.app?.stage.renderer.info.render.frame) await new Promise(requestAnimationFrame);
}"""
COUNT = """seconds => new Promise(done => {
    let frames = 0, began = 0;
    onFrame(() => { frames += 1; });
    app.setPlaying(true);
    setTimeout(() => { frames = 0; began = performance.now(); }, 500);
    setTimeout(() => done(1000 * frames / (performance.now() - began)), 500 + 1000 * seconds);
})"""


def long_clip(joints: int, frames: int) -> Motion:
    """A walk of many frames, with more joints, all of which turn."""
    walk = read_bvh(SAMPLES / "walk.bvh")
    body, times = walk.skeleton, np.arange(frames) % len(walk)
    more = joints - len(body)
    wrists = np.resize([joint for joint in body.joints if body.names[joint].endswith("Wrist")], more)
    skeleton = Skeleton(
        names=(*body.names, *(f"finger_{k}" for k in range(more))),
        parents=np.concatenate([body.parents, wrists]),
        offsets=np.concatenate([body.offsets, np.tile(0.05 * body.offsets.max(), (more, 3))]),
        channels=(*body.channels, *[("Zrotation", "Xrotation", "Yrotation")] * more),
        end_sites=np.concatenate([body.end_sites, np.zeros(more, bool)]),
    )
    angles = np.sin(np.arange(frames)[:, None] / 20 + np.arange(more)) / 4
    turns = np.stack([np.sin(angles), 0 * angles, 0 * angles, np.cos(angles)], axis=2)
    rotations = np.concatenate([walk.rotations[times], turns], axis=1)
    return Motion(skeleton, walk.root_positions[times], rotations, walk.frame_time_text)


def finer(mesh: SkinnedMesh, triangles: int) -> SkinnedMesh:
    """The mesh with at least so many triangles: each is cut in two again and again."""
    while len(mesh.triangles) < triangles:
        a, b, c = mesh.triangles.T
        middles = len(mesh.vertices) + np.arange(len(a))
        mesh = SkinnedMesh(
            np.concatenate([mesh.vertices, (mesh.vertices[a] + mesh.vertices[b]) / 2]),
            np.concatenate([mesh.joints, mesh.joints[a]]),
            np.concatenate([mesh.weights, mesh.weights[a]]),
            np.concatenate([np.stack([a, middles, c], axis=1), np.stack([middles, b, c], axis=1)])[:triangles],
        )
    return mesh


def measure(browser: Browser, name: str, page: str, folder: str) -> None:
    """Print the metrics of a page."""
    path = Path(folder) / "page.html"
    path.write_text(page, "utf-8")
    tab = browser.new_page(viewport={"width": 900, "height": 900})
    began = time.perf_counter()
    tab.goto(path.as_uri())
    tab.evaluate(DRAWN)
    first = time.perf_counter() - began
    tab.evaluate("() => { document.querySelector('.view').style.cssText = 'width: 900px; height: 700px'; }")
    rate = tab.evaluate(COUNT, SECONDS)
    tab.close()
    print(f"{name:52}{len(page.encode()) / 1e6:6.2f} MB{first:8.2f} s{rate:8.1f} frames/s")


def main(character: Path | None) -> None:
    """Make pages and measure them."""
    walk, clip = read_bvh(SAMPLES / "walk.bvh"), long_clip(65, 10_000)
    hero = load_target(character or SAMPLES.parent / "sample_characters" / "hero.glb")
    assert isinstance(hero, Target)
    mesh = hero.mesh()
    assert mesh is not None
    fine = mesh if character else finer(mesh, 30_000)
    dressed = Target(hero.skeleton, {}, "", mesh=lambda: fine)
    plain = Target(Body.of_motion(walk).skeleton, {}, "")
    long, short = diff(clip, clip), diff(walk, walk)
    pages = {
        "a body of capsules": view_page([shown_actor("walk", 0, plain, walk)], "walk"),
        f"a character of {len(fine.triangles)} triangles": view_page(
            [shown_actor("hero", 0, dressed, retarget(walk, hero).motion)], "hero"
        ),
        "two bodies of capsules": diff_page(short, document(short, About(a="a", b="b"))),
        "a diff of 10,000 frames of 65 joints, two bodies": diff_page(long, document(long, About(a="a", b="b"))),
    }
    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))))
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        browser = playwright.chromium.launch(executable_path=program, args=[*FLAGS])
        for name, page in pages.items():
            measure(browser, name, page, folder)
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else None)
