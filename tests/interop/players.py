"""Other programs that play files of characters: glTF, VRM and VRM animations.

    with Players() as players:
        positions = players.play("three.js", path, "walk", times, nodes)    # (frames, nodes, 3) [m]

Nodes count by their index in the file.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote, unquote, urlsplit

import gltf_player
import numpy as np

from interop.readers import BLENDER, HERE, PACKAGES, without_blender, without_packages

PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "chrome")
IN_BROWSER = {"three.js": "three", "Babylon.js": "@babylonjs/loaders", "three-vrm": "@pixiv/three-vrm"}
PLAYERS = (*IN_BROWSER, "Blender")
FLAGS = ("--no-sandbox", "--disable-background-networking", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


def missing(program: str) -> str:
    """Why a program cannot be asked here; empty if it can."""
    if program == "Blender":
        return without_blender()
    if program == "validator":
        return without_packages("gltf-validator")
    lacking = without_packages("esbuild", IN_BROWSER[program])
    return lacking or ("" if _browser() else "no Chromium or Chrome is installed")


def _browser() -> str | None:
    return next(filter(None, map(shutil.which, PROGRAMS)), None)


def problems(path: Path) -> set[tuple[str, str]]:
    """The errors that the Khronos validator finds in a file: codes, and where they are."""
    return {(issue["code"], issue["pointer"]) for issue in issues(path) if issue["severity"] == 0}


def issues(path: Path) -> list[dict]:
    """All that the Khronos validator has to say of a file; severity is 0 for errors, 1 for warnings."""
    command = ["node", HERE / "gltf_validator.cjs", Path(os.environ[PACKAGES]).resolve(), path.resolve()]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=True)
    return json.loads(done.stdout.strip().splitlines()[-1])


def number_of(path: Path, animation: int | str | None) -> int | None:
    """The number of an animation, by number or name; VRM animations have one without a name."""
    if not isinstance(animation, str):
        return animation
    document, _ = gltf_player.load(path)
    return [entry.get("name", "") for entry in document["animations"]].index(animation)


@dataclass
class Players:
    """The programs; the browser starts when it is first needed and stops at the end of the block."""

    _open: ExitStack = field(default_factory=ExitStack)
    _tab: object = None

    def __enter__(self) -> Players:
        return self

    def __exit__(self, *about: object) -> None:
        self._open.close()

    def play(
        self,
        program: str,
        path: Path,
        animation: int | str | None,
        times: Iterable[float],
        nodes: Iterable[int],
        *,
        vrma: Path | None = None,
    ) -> np.ndarray:
        """Return where a program has nodes at some times, (times, nodes, 3) [m]; NaN where it knows no such node.

        Args:
            program: one of `PLAYERS`.
            path: the file.
            animation: the animation, by name or number; None for the pose that the nodes show.
            times: [s].
            nodes: numbers of nodes in the file.
            vrma: the file of the animation, for three-vrm to play on the VRM in `path`.
        """
        path, nodes = path.resolve(), [int(node) for node in nodes]
        task = {
            "animation": number_of(vrma or path, animation),
            "times": [float(time) for time in times],
            "nodes": nodes,
        }
        if program == "Blender":
            return _positions(_blender(task, path))
        return _positions(self._asked(program, path, task, vrma))

    def _asked(self, program: str, path: Path, task: dict, vrma: Path | None) -> list:
        if vrma:
            task = task | {"vrma": _address(vrma.resolve())}
        call = "([program, url, task]) => window.players[program](url, task)"
        return self._page().evaluate(call, [program, _address(path), task])

    def _page(self):
        if self._tab is None:
            from playwright.sync_api import sync_playwright

            playwright = self._open.enter_context(sync_playwright())
            browser = playwright.chromium.launch(executable_path=_browser(), args=list(FLAGS))
            self._open.callback(browser.close)
            tab = browser.new_page()
            tab.route("http://players/**", _serve)
            tab.goto("http://players/")
            page = build(Path(self._open.enter_context(tempfile.TemporaryDirectory())))
            tab.add_script_tag(url=_address(page), type="module")
            tab.wait_for_function("window.players")
            self._tab = tab
        return self._tab


def _address(path: Path) -> str:
    return f"http://players{quote(str(path))}"


def _serve(route) -> None:
    """Answer the browser with a file, or an empty page."""
    path = Path(unquote(urlsplit(route.request.url).path))
    if path.is_file():
        kind = "text/javascript" if path.suffix == ".js" else "application/octet-stream"
        route.fulfill(body=path.read_bytes(), content_type=kind)
    elif path == Path("/"):
        route.fulfill(body="<!doctype html><meta charset=utf-8>", content_type="text/html")
    else:
        route.fulfill(status=404)


def build(folder: Path) -> Path:
    """Bundle the script of the page with the npm packages into a folder, and return it."""
    packages = Path(os.environ[PACKAGES]).resolve() / "node_modules"
    options = ["--bundle", "--format=esm", "--splitting", "--log-level=error", f"--outdir={folder}"]
    command = [packages / ".bin" / "esbuild", HERE / "players_page.mjs", *options]
    subprocess.run(list(map(str, command)), check=True, env=os.environ | {"NODE_PATH": str(packages)})
    return folder / "players_page.js"


def _blender(task: dict, path: Path) -> list:
    with tempfile.TemporaryDirectory() as folder:
        file = path
        if path.suffix not in (".glb", ".gltf"):
            file = Path(folder) / "character.glb"
            shutil.copy(path, file)
        asked = Path(folder) / "task.json"
        asked.write_text(json.dumps(task | {"file": str(file)}))
        command = [os.environ[BLENDER], str(HERE / "blender_gltf.py"), str(asked)]
        done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"Blender fails on {path.name}: {(done.stderr.strip().splitlines() or ['no message'])[-1]}")
    return json.loads(done.stdout.strip().splitlines()[-1])


def _positions(found: list) -> np.ndarray:
    """Positions (times, nodes, 3) of lists in which a node may be None."""
    nowhere = [np.nan] * 3
    return np.array([[place or nowhere for place in places] for places in found], float)
