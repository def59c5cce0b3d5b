"""Compile all code, or load what is kept of an earlier run, before there is work to do."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from distretarget.body.axes import axis_vector
from distretarget.body.body import Body
from distretarget.body.resting import joint_speeds, still_joints
from distretarget.io.bvh import parse_bvh
from distretarget.io.bvh_writer import format_bvh
from distretarget.io.json_node import without_collection
from distretarget.measure.skin import find_skin, find_source_skin
from distretarget.motion import Motion
from distretarget.numerics.compiled import code_folder
from distretarget.numerics.interrupts import interrupts_kept
from distretarget.numerics.joint_paths import heights_of
from distretarget.numerics.time_series import median_of_three
from distretarget.objectives.skin import BodySkin
from distretarget.pipeline.options import Objective, Options
from distretarget.pipeline.retargeting import retarget
from distretarget.skeleton import USUAL_ROOT, USUAL_ROTATIONS, Skeleton
from distretarget.skin.balls import segment_gaps
from distretarget.skin.capsules import SEGMENTS, Capsules
from distretarget.skin.displacement import displacements
from distretarget.skin.limbs import Limb, bent

JOINTS = 6  # enough for a pair of joints so far apart along the tree that the solver keeps it as a contact


@interrupts_kept()
def warm(objective: Objective, *, skin: bool = True) -> None:
    """Read, retarget, measure and write a clip of two frames, so that all code for `objective` is ready; also that for
    bodies with a `skin`, a third of the time.
    """
    with without_collection():  # it takes a tenth of the time of compiling
        source, target = _clip()
        _run_for_legs(source)
        retarget(source, target, Options(objective=objective)).metrics  # noqa: B018 - what it needs is compiled
        if skin:
            _measure_skin(source)


def warm_for_others(objective: Objective) -> None:
    """Compile all code for `objective` so that other processes find it, unless an earlier run has done so."""
    folder = code_folder()
    mark = folder / f"whole-{objective}" if folder else None
    if mark is None or not mark.exists():
        warm(objective)
    if mark:
        with suppress(OSError):
            mark.touch()


def _clip() -> tuple[Motion, Skeleton]:
    """A clip that was written and read, and a target for it."""
    names = tuple(f"joint{number}" for number in range(JOINTS))
    offsets = np.array([[0.0, 0.0, 0.0], *([[0.0, 1.0, 0.0]] * (JOINTS - 1))])
    channels = (USUAL_ROOT, *((USUAL_ROTATIONS,) * (JOINTS - 1)))
    body = Skeleton(
        names=names, parents=np.arange(JOINTS) - 1, offsets=offsets, channels=channels, end_sites=np.zeros(JOINTS, bool)
    )
    bent = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, np.sin(0.6), np.cos(0.6)]])
    motion = Motion(body, np.zeros((2, 3)), np.tile(bent[:, None], (1, JOINTS, 1)), "0.01")
    return parse_bvh(format_bvh(motion), "joints"), body.with_offsets(1.5 * offsets)


def _measure_skin(source: Motion) -> None:
    """Run what measures the skin of a body, and what keeps it apart."""
    body, segments = Body.of_motion(source), [SEGMENTS.index(name) for name in ("pelvis", "left hand")]
    ends, radii = np.zeros((2, 2, 3)), np.ones((2, 2))
    capsules = Capsules(np.array([0, JOINTS - 1]), ends, radii, np.array(segments))
    skin = find_skin(body, capsules)
    find_source_skin(source, body, axis_vector("Y"), skin, skin).in_result(source)
    solid = BodySkin.of(body, capsules)
    posed, frames = median_of_three(solid.posed(source)), len(source)
    gaps, some = segment_gaps(solid.balls, posed, 1.0), np.zeros((frames, 1, 2, 3))
    limbs, free = np.zeros((frames, 1, 3, 3)), np.ones((frames, 1, 2))
    displacements(solid.balls, solid.displaced, posed, limbs, free, gaps, gaps, gaps, some)
    bent(source, (Limb(1, 2, 3, True),), some + 0.1)


def _run_for_legs(source: Motion) -> None:
    """Run what only bodies with legs need."""
    joints, shots = np.arange(JOINTS), np.zeros(len(source), np.intp)
    heights_of(source.positions, joints, axis_vector("Y"))
    still_joints(source, joints, joints, joint_speeds(source, joints, shots), 1.0, shots)
    source.world_rotations_of(0)
