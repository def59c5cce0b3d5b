"""What a result says of its frames, as arrays for a data set: what rests and touches, cuts, frames to leave out."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from distretarget.measure.metrics import METRICS, clip_limits
from distretarget.numerics.vectors import lengths
from distretarget.pipeline.result import RetargetResult

Labels = dict[str, NDArray[Any]]

JUDGED = tuple(metric for metric in METRICS if metric.limit and metric.of_frames)  # those that flag frames


def labels_of(result: RetargetResult) -> Labels:
    """Return the labels of the frames of a result.

    - `support_names`, (supports,), and `support_weights`, (frames, supports): joints that rest on the world, and how
      firmly, 1 while the source's joint rests, blended to 0. Foot joints come first.
    - `contact_names`, (pairs,), and `contact_gaps`, (frames, pairs): the regions of the body that can touch, and while
      they touch in the source how far their nearest joints are apart in the result [file units]; nan while they do not.
    - `shots`, (frames,): the number of the shot of each frame, from 0; it goes up at a cut.
    - `not_converged`, (frames,): whether the solver did not converge.
    - `flag_names`, (flags,), and `flags`, (frames, flags): the metrics with a limit, and whether a frame is
      above it, of the metrics that are over their limits in the clip as a whole.
    """
    not_converged = np.zeros(len(result.motion), bool)
    not_converged[result.effort.not_converged] = True
    keys, supports = result.motion.skeleton.keys, result.supports
    return {
        "support_names": np.array([keys[joint] for joint in supports.joints], np.str_),
        "support_weights": supports.weights,
        "contact_names": np.array(result.comparison.contacts.candidates.names, np.str_),
        "contact_gaps": _contact_gaps(result),
        "shots": result.matching.source.shots_of(result.source),
        "not_converged": not_converged,
        "flag_names": np.array([metric.key for metric in JUDGED], np.str_),
        "flags": _flags(result),
    }


def _contact_gaps(result: RetargetResult) -> NDArray[np.float64]:
    contacts, positions = result.comparison.contacts, result.motion.positions
    gaps = np.full((len(positions), len(contacts.candidates.names)), np.nan)
    apart = positions[contacts.frame, contacts.u] - positions[contacts.frame, contacts.v]
    gaps[contacts.frame, contacts.regions] = lengths(apart)
    return gaps


def _flags(result: RetargetResult) -> NDArray[np.bool_]:
    frames, tracks, limits = len(result.motion), result.tracks["result"], clip_limits(result.metrics)
    flags = np.zeros((frames, len(JUDGED)), bool)
    for column, metric in enumerate(JUDGED):
        limit = limits[metric.key]
        if limit is not None and metric.over_limit(result.metrics):
            flags[:, column] = metric.over_time(tracks, frames) > (0.0 if metric.reduction == "frames" else limit)
    return flags
