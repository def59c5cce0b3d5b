"""Draw a character as a shaded mesh, posed by a motion."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import image
from sample_mesh import normals_of
from scipy.spatial.transform import Rotation

from distretarget import Motion
from distretarget.numerics.vectors import Array
from distretarget.skin.mesh import SkinnedMesh

SIZE = (300, 400)  # of the picture of a figure: width, height [pixels]
FINER = 2  # it is drawn so many times as large, for smooth edges
HEIGHT = 2.0  # what it shows [m]
FLOOR = 0.07  # where the floor is in it, from below
VIEW = Rotation.from_euler("YX", [-28, 8], degrees=True)
LIGHT = np.array([0.3, 0.6, 0.75]) / np.linalg.norm([0.3, 0.6, 0.75])
SOFT = 0.35  # the light from everywhere


def write_figures(path: Path, mesh: SkinnedMesh, figures: Sequence[tuple[Motion, int]]) -> None:
    """Write a picture of figures side by side: motions of a character whose mesh is in metres, and a frame of each."""
    path.parent.mkdir(parents=True, exist_ok=True)
    drawn = np.concatenate([drawn_figure(mesh, motion[frame : frame + 1]) for motion, frame in figures], axis=1)
    image.imsave(path, np.rint(255 * np.clip(drawn, 0, 1) ** (1 / 2.2)).astype(np.uint8))


def drawn_figure(mesh: SkinnedMesh, motion: Motion) -> Array:
    """(height, width, 3), the first frame in linear colours on white, with the hips above the origin."""
    width, height = (FINER * each for each in SIZE)
    colours, depths = np.ones((height, width, 3)), np.full((height, width), -np.inf)
    points = mesh.posed(motion)[0] - motion.positions[0, 0] * (1, 0, 1)
    shade = SOFT + (1 - SOFT) * np.clip(VIEW.apply(normals_of(points, mesh.triangles)) @ LIGHT, 0, 1)
    seen = VIEW.apply(points) * height / HEIGHT
    seen[:, 0] += 0.5 * width
    seen[:, 1] = height * (1 - FLOOR) - seen[:, 1]
    assert mesh.looks
    materials = np.array([material.colour[:3] for material in mesh.looks.materials])
    for corners, material in zip(mesh.triangles, mesh.looks.of_triangle, strict=True):
        _fill(colours, depths, seen[corners], shade[corners], materials[material])
    return colours.reshape(SIZE[1], FINER, SIZE[0], FINER, 3).mean(axis=(1, 3))


def _fill(colours: Array, depths: Array, corners: Array, shade: Array, colour: Array) -> None:
    """Draw a triangle, with the shade between its corners, where nothing is in front of it."""
    low, high = np.floor(corners[:, :2].min(axis=0)).astype(int), np.ceil(corners[:, :2].max(axis=0)).astype(int)
    low, high = np.maximum(low, 0), np.minimum(high, np.array(depths.shape)[::-1] - 1)
    (ax, ay), (bx, by), (cx, cy) = corners[:, :2]
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if area >= -1e-12 or (high < low).any():  # it looks away: y points down here
        return
    x, y = np.meshgrid(np.arange(low[0], high[0] + 1) + 0.5, np.arange(low[1], high[1] + 1) + 0.5)
    second = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
    third = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
    parts = np.stack([1 - second - third, second, third], axis=-1)
    depth = parts @ corners[:, 2]
    inside = slice(low[1], high[1] + 1), slice(low[0], high[0] + 1)
    shown = (parts.min(axis=-1) >= -1e-9) & (depth > depths[inside])
    depths[inside][shown] = depth[shown]
    colours[inside][shown] = (parts @ shade)[shown][:, None] * colour
