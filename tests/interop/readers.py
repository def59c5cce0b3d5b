"""Other programs that read BVH files, and where each finds the joints."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__).parent
PACKAGES = "DISTRETARGET_NODE"  # names the folder in which npm has installed packages
BLENDER = "DISTRETARGET_BLENDER"  # names the Python of an environment with the package bpy
Places = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Reader:
    """A program that reads BVH files.

    Attributes:
        name: its name.
        read: returns, for a file and a number of frames, the positions (frames, 3) of each joint by its name.
        missing: returns why it cannot be asked here; empty if it can.
    """

    name: str
    read: Callable[[Path, int], Places]
    missing: Callable[[], str]


def _pybvh(path: Path, frames: int) -> Places:
    import pybvh

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pybvh warns that it guesses the up axis
        clip = pybvh.read_bvh_file(path)
    places = clip.node_positions()[:frames]
    return {node.name: places[:, number] for number, node in enumerate(clip.nodes)}


def _bvhio(path: Path, frames: int) -> Places:
    import bvhio

    root = bvhio.readAsHierarchy(str(path))
    poses = []
    for frame in range(frames):
        root.loadPose(frame)
        poses.append({joint.Name: joint.PositionWorld.to_tuple() for joint, _, _ in root.layout()})
    return {name: np.array([pose[name] for pose in poses]) for name in poses[0]}


def _by_node(script: str) -> Callable[[Path, int], Places]:
    """Ask a script for node.js."""

    def read(path: Path, frames: int) -> Places:
        return _asked("node", HERE / script, Path(os.environ[PACKAGES]).resolve(), path, frames)

    return read


def _blender(path: Path, frames: int) -> Places:
    return _asked(os.environ[BLENDER], HERE / "blender.py", path, frames)


def _asked(*command: object) -> Places:
    """What a program prints as its last line."""
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=True)
    answer = json.loads(done.stdout.strip().splitlines()[-1])
    return dict(zip(answer["names"], np.array(answer["positions"]).transpose(1, 0, 2), strict=True))


def _module(name: str) -> Callable[[], str]:
    return lambda: "" if importlib.util.find_spec(name) else f"the package {name} is not installed"


def without_packages(*names: str) -> str:
    """Why node.js has not all of these npm packages; empty if it has."""
    if not shutil.which("node"):
        return "node.js is not installed"
    if PACKAGES not in os.environ:
        return f"{PACKAGES} does not name a folder with the npm packages {' and '.join(names)}"
    lacking = [name for name in names if not (Path(os.environ[PACKAGES]) / "node_modules" / name).is_dir()]
    return f"the npm package {lacking[0]} is not in {os.environ[PACKAGES]}" if lacking else ""


def without_blender() -> str:
    """Why Blender cannot be asked; empty if it can."""
    return "" if BLENDER in os.environ else f"{BLENDER} does not name a Python with the package bpy"


READERS = (
    Reader("pybvh", _pybvh, _module("pybvh")),
    Reader("bvhio", _bvhio, _module("bvhio")),
    Reader("three.js", _by_node("three.mjs"), partial(without_packages, "three")),
    Reader("assimp", _by_node("assimp.cjs"), partial(without_packages, "assimpjs")),
    Reader("Babylon.js", _by_node("babylon.mjs"), partial(without_packages, "@babylonjs/loaders")),
    Reader("Blender", _blender, without_blender),
)
