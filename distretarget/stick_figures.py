"""Small pictures of postures as inline SVG, for notebooks and pages."""

from __future__ import annotations

import html

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.vectors import Array

HEIGHT = 100.0  # of a picture [units of SVG]
GAP = 12.0  # around and between postures [units of SVG]
ASIDE = np.radians(25)  # angle between the view and the view in which the first posture is widest [rad]
STYLE = "height:9em;max-width:100%;color:inherit"
BONE = 'fill="none" stroke="currentColor" stroke-width="1.6" stroke-linecap="round"'


def stick_figures(parents: NDArray[np.intp], postures: Array, up: Array, label: str, marked: int = -1) -> str:
    """Return an SVG with postures, (postures, joints, 3), side by side, seen from near where the first is widest.

    `up` is the unit vector up, (3,); `label` describes the picture; the joint `marked` gets a red dot.
    """
    heights = postures @ up
    level = postures[0] - heights[0][:, None] * up
    spread = level - level.mean(axis=0)
    widest = np.asarray(np.linalg.svd(spread.T @ spread)[2][0])
    if widest[np.abs(widest).argmax()] <= 0 and abs(widest @ up) <= 0.5:
        widest = -widest  # to the right seen from the front
    across = np.cos(ASIDE) * widest - np.sin(ASIDE) * np.cross(widest, up)
    x, y = postures @ across, heights.max() - heights
    scale = HEIGHT / max(np.ptp(y), np.ptp(x[0]) / 3, 1e-300)
    x, y = scale * (x - x.min(axis=1, keepdims=True)), scale * y
    left, parts = GAP, []
    for across_here, down in zip(x, y, strict=True):
        points = [f"{a:.1f} {b:.1f}" for a, b in zip(across_here + left, down + GAP, strict=True)]
        lines = "".join(f"M{points[p]}L{points[j]}" for j, p in enumerate(parents.tolist()) if p >= 0)
        parts.append(f'<path {BONE} d="{lines}"/>')
        if marked >= 0:
            at = points[marked].split()
            parts.append(f'<circle cx="{at[0]}" cy="{at[1]}" r="4" fill="#d0213b"/>')
        left += float(np.ptp(across_here)) + GAP
    box = f"0 0 {left:.0f} {float(y.max()) + 2 * GAP:.0f}"
    text = html.escape(label)
    return f'<svg viewBox="{box}" style="{STYLE}" role="img" aria-label="{text}">{"".join(parts)}</svg>'


def likely_up(posture: Array, stated: str | None) -> Array:
    """Return the unit vector up, (3,): the stated axis, or the one of Y and Z along which a posture is taller."""
    axis = stated or "YZ"[int(np.argmax(np.ptp(posture, axis=0)[1:]))]
    return np.asarray(np.eye(3)["XYZ".index(axis[-1])] * (-1.0 if axis[0] == "-" else 1.0))
