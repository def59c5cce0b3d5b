"""Read BVH files as distretarget writes them, with names and digits that Blender's own importer would cut."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Clip:
    """A motion.

    Attributes:
        parents: the parent of each joint by name, parents first; None for the root. End Sites are left out.
        offsets: (3,) of each joint [file units].
        poses: (frames, 4, 4) of each joint, from its own space to the world.
        frame_time: time between frames [s].
    """

    parents: dict[str, str | None]
    offsets: dict[str, np.ndarray]
    poses: dict[str, np.ndarray]
    frame_time: float

    def __len__(self) -> int:
        return len(next(iter(self.poses.values())))


def read_clip(path: Path) -> Clip:
    """Read a BVH file; end with one line if it is none."""
    try:
        hierarchy, motion = path.read_text("utf-8").split("\nMOTION\n")
        _, time, *rows = motion.splitlines()
        values = np.array([row.split() for row in rows], float)
        return _clip(hierarchy.splitlines(), values, float(time.removeprefix("Frame Time:")))
    except OSError as error:
        raise SystemExit(f"Error: {path}: {error.strerror}") from error
    except (ValueError, IndexError, KeyError) as error:
        raise SystemExit(f"Error: {path}: is no BVH file that distretarget has written") from error


def _clip(lines: list[str], values: np.ndarray, frame_time: float) -> Clip:
    """The motion with a HIERARCHY and `values`, (frames, channels)."""
    parents: dict[str, str | None] = {}
    offsets, poses, open_joints, column = {}, {}, [None], 0
    for line in lines:
        word, _, rest = line.strip().partition(" ")
        if word in ("ROOT", "JOINT"):
            parents[rest] = open_joints[-1]
            open_joints.append(rest)
        elif word == "End":
            open_joints.append(None)
        elif word == "}":
            open_joints.pop()
        elif word == "OFFSET" and open_joints[-1] is not None:
            offsets[open_joints[-1]] = np.array(rest.split(), float)
        elif word == "CHANNELS":
            name, channels = open_joints[-1], rest.split()[1:]
            local = _local(offsets[name], channels, values[:, column : column + len(channels)])
            above = poses.get(parents[name], np.eye(4))
            poses[name] = above @ local
            column += len(channels)
    return Clip(parents, offsets, poses, frame_time)


def _local(offset: np.ndarray, channels: list[str], values: np.ndarray) -> np.ndarray:
    """(frames, 4, 4), from the space of a joint to that of its parent."""
    local = np.tile(np.eye(4), (len(values), 1, 1))
    local[:, :3, 3] = offset
    for channel, column in zip(channels, values.T, strict=True):
        axis = "XYZ".index(channel[0])
        if channel.endswith("position"):
            local[:, axis, 3] = column
        else:
            local[:, :3, :3] @= _turns(axis, np.radians(column))
    return local


def _turns(axis: int, angles: np.ndarray) -> np.ndarray:
    """(frames, 3, 3), rotations about the axis 0, 1 or 2 [rad]."""
    turns = np.tile(np.eye(3), (len(angles), 1, 1))
    one, other = (axis + 1) % 3, (axis + 2) % 3
    turns[:, one, one] = turns[:, other, other] = np.cos(angles)
    turns[:, other, one] = np.sin(angles)
    turns[:, one, other] = -np.sin(angles)
    return turns
