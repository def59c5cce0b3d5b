"""Scales of nodes: uniform ones are kept, of others it is said what is lost."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from distretarget.character.bind_pose import REGULAR
from distretarget.character.nodes import Scene
from distretarget.errors import FileError, cut, quoted
from distretarget.skeleton import LARGEST, SMALLEST

Array = NDArray[np.float64]

FLAT = 1e-6  # axes that are shorter have the length 0 [of the longest axis of the node]
UNEVEN = 1e-3  # axes whose scales differ by more than this are scaled unevenly; a scale that changes more is animated


def without_flat_scales(scene: Scene) -> tuple[Scene, NDArray[np.bool_]]:
    """Return the scene with scales that can be inverted, and which nodes had others, (nodes,): axes of length 0 get the
    length of the longest, or 1.
    """
    scales = scene.nodes.scales
    longest = np.abs(scales).max(axis=1, keepdims=True, initial=0.0)
    flat = ~(np.abs(scales) > np.maximum(FLAT * longest, SMALLEST))
    regular = np.where(flat, np.where(longest > SMALLEST, longest, 1.0), scales)
    return replace(scene, nodes=replace(scene.nodes, scales=regular)), flat.any(axis=1)


def flat_warnings(scene: Scene, flat: NDArray[np.bool_], line: Sequence[int]) -> Iterator[str]:
    """Yield a line for nodes with axes of length 0."""
    if names := [scene.nodes.names[node] for node in line if flat[node]]:
        yield f"{quoted(names)} have the scale 0, as hidden nodes have; they are taken at full size"


def check_scales(scene: Scene, line: Sequence[int], shown: Array) -> None:
    """Check that the transforms of some nodes in the world, among all, (nodes, 4, 4), can be computed with; a FileError
    if not.
    """
    world = shown[list(line)]
    sizes = np.abs(world[:, :3, :3]).max(axis=(1, 2))
    with np.errstate(all="ignore"):
        regular = (np.abs(np.linalg.det(world[:, :3, :3])) > REGULAR * sizes**3) & (sizes >= SMALLEST)
        fits = regular & (sizes <= LARGEST) & (np.abs(world[:, :3, 3]) <= LARGEST).all(axis=1)
    if not fits.all():
        name = scene.nodes.names[line[int(fits.argmin())]]
        limits = f"scales from {SMALLEST:g} to {LARGEST:g}, not too uneven, and places up to {LARGEST:g}"
        raise FileError(
            scene.path, f"the scale or place of {cut(name)!r} in the world is too extreme; expected {limits}"
        )


def scale_warnings(scene: Scene, line: Sequence[int]) -> Iterator[str]:
    """Yield a line for nodes that are scaled unevenly, and one for nodes whose scale changes."""
    nodes, sizes = scene.nodes, np.abs(scene.nodes.scales[list(line)])
    spread = np.ptp(sizes, axis=1) / sizes.max(axis=1)
    if uneven := [nodes.names[node] for node, share in zip(line, spread, strict=True) if share > UNEVEN]:
        change = "bones below change their length as they turn, so that hands and feet miss their places"
        much = f"{100 * spread.max():.2g} %"
        yield f"the scale of {quoted(uneven)} is uneven, by {much}: {change}; apply the scale and export it again"
    scales = scene.animation.scales if scene.animation else {}
    changing = [
        nodes.names[node]
        for node in line
        if node in scales and (np.abs(scales[node] - scales[node][:1]) > UNEVEN * np.abs(scales[node][:1])).any()
    ]
    if changing:
        yield f"the scales of {quoted(changing)} change in the animation; they are left out"
