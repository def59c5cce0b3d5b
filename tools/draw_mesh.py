"""Draw the sample character as a shaded mesh, posed by a motion."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import image
from numpy.typing import NDArray
from sample_character import joints, mesh
from scipy.spatial.transform import Rotation

from distretarget import Motion

Array = NDArray[np.float64]

SIZE = (300, 400)  # of the picture of a figure: width, height [pixels]
FINER = 2  # it is drawn so many times as large, for smooth edges
HEIGHT = 2.0  # what it shows [m]
FLOOR = 0.07  # where the floor is in it, from below
VIEW = Rotation.from_euler("YX", [-28, 8], degrees=True)
LIGHT = np.array([0.3, 0.6, 0.75]) / np.linalg.norm([0.3, 0.6, 0.75])
SOFT = 0.35  # the light from everywhere


def write_figures(path: Path, figures: Sequence[tuple[Motion, int]]) -> None:
    """Write a picture of figures side by side: motions of the sample character, and a frame of each."""
    drawn = np.concatenate([drawn_figure(motion, frame) for motion, frame in figures], axis=1)
    image.imsave(path, np.rint(255 * np.clip(drawn, 0, 1) ** (1 / 2.2)).astype(np.uint8))


def drawn_figure(motion: Motion, frame: int) -> Array:
    """(height, width, 3), a figure in linear colours on white."""
    width, height = (FINER * each for each in SIZE)
    colours, depths = np.ones((height, width, 3)), np.full((height, width), -np.inf)
    scale = height / HEIGHT
    for points, normals, triangles, colour in posed(motion, frame):
        seen, facing = VIEW.apply(points) * scale, VIEW.apply(normals)
        seen[:, 0] += 0.5 * width
        seen[:, 1] = height * (1 - FLOOR) - seen[:, 1]
        shade = SOFT + (1 - SOFT) * np.clip(facing @ LIGHT, 0, 1)
        for corners in triangles:
            _fill(colours, depths, seen[corners], shade[corners], np.asarray(colour))
    return colours.reshape(SIZE[1], FINER, SIZE[0], FINER, 3).mean(axis=(1, 3))


def posed(motion: Motion, frame: int) -> list[tuple[Array, Array, NDArray[np.intp], tuple[float, float, float]]]:
    """The parts of the mesh in a frame, with the hips above the origin: points [m], normals, triangles and colour."""
    bones = joints()
    order = [motion.skeleton.index(name) for name in bones.names]
    turns = Rotation.from_quat(motion.world_rotations[frame, order]).as_matrix()
    places = motion.positions[frame, order].copy()
    places[:, [0, 2]] -= places[0, [0, 2]]
    result = []
    for part in mesh(bones):
        share = (part.shares / 255)[..., None]
        arms = 0.01 * (part.surface.points[:, None] - bones.places[part.joints])
        points = (share * (_turned(turns, part.joints, arms) + places[part.joints])).sum(axis=1)
        normals = (share * _turned(turns, part.joints, part.surface.normals[:, None].repeat(4, axis=1))).sum(axis=1)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        result.append((points, normals, part.surface.triangles, part.colour))
    return result


def _turned(turns: Array, numbers: NDArray[np.intp], vectors: Array) -> Array:
    """(points, 4, 3), vectors turned by the joints of each point."""
    return np.einsum("pkij,pkj->pki", turns[numbers], vectors)


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
