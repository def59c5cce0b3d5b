"""Everything compiled, or loaded from the cache of compiled code, before there is work to do."""

from __future__ import annotations

import numpy as np

from distretarget.io.bvh import format_bvh, parse_bvh
from distretarget.motion import Motion
from distretarget.retargeting import Objective, retarget
from distretarget.skeleton import POSITION_CHANNELS, Skeleton

CHANNELS = ("Zrotation", "Xrotation", "Yrotation")
BONES = 6  # on the path of a pair that may touch, and so is held


def warm(objective: Objective) -> None:
    """Take a clip of two frames through all that `objective` needs."""
    names = tuple(f"joint{number}" for number in range(BONES))
    offsets = np.array([[0.0, 0.0, 0.0], *([[0.0, 1.0, 0.0]] * (BONES - 1))])
    channels = (POSITION_CHANNELS + CHANNELS, *((CHANNELS,) * (BONES - 1)))
    body = Skeleton(names, np.arange(BONES) - 1, offsets, channels, np.zeros(BONES, bool))
    bent = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, np.sin(0.6), np.cos(0.6)]])
    motion = Motion(body, np.tile(offsets, (2, 1, 1)), np.tile(bent[:, None], (1, BONES, 1)), "0.01")
    source = parse_bvh(format_bvh(motion), "joints")
    result = retarget(source, body.with_offsets(1.5 * offsets), objective=objective)
    result.figures  # noqa: B018 - what it needs is compiled
    format_bvh(result.motion)
