"""What is found of rigs is found once for all clips, is right for each, and is not kept for ever."""

import gc
import weakref
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from bodies import HERO, sample, sample_target, swaying
from zoo import rig

from distretarget import Skeleton, load_target, retarget
from distretarget.body.body import Body
from distretarget.matching.matching import match
from distretarget.rig import CACHED_RIGS, rig_cached


def again(skeleton: Skeleton) -> Skeleton:
    """An equal skeleton, as another file has it."""
    return skeleton.with_offsets(skeleton.offsets)


def longer(skeleton: Skeleton, factor: float) -> Skeleton:
    """The skeleton with longer bones."""
    return skeleton.with_offsets(factor * skeleton.offsets)


def of_result(result):
    """What must not depend on what was retargeted before."""
    arrays = [array.tobytes() for array in (result.motion.rotations, result.motion.root_positions)]
    return arrays, result.metrics, result.verdict


def test_skeletons_with_the_same_content_are_equal():
    skeleton = rig("mixamo", "T")
    assert again(skeleton) == skeleton != longer(skeleton, 1.5)
    assert hash(again(skeleton)) == hash(skeleton)
    assert skeleton != skeleton.turned_round()
    assert skeleton != "skeleton"


def test_clips_of_equal_skeletons_have_one_rig():
    one, other = (Body.of_motion(swaying(again(rig("mixamo", "T")), seed=seed)) for seed in (1, 2))
    assert one.rig is other.rig
    assert one.rig.motion is None
    assert one.reference is other.reference
    assert one.regions is other.regions
    assert Body.of_motion(swaying(longer(one.skeleton, 1.5))).rig is not one.rig


def test_matchings_of_equal_skeletons_have_one_rig():
    target = Body.of(rig("unreal", "A"))
    one, other = (match(Body.of_motion(swaying(again(rig("mixamo", "T")), seed=seed)), target) for seed in (1, 2))
    assert one.rig is other.rig
    assert one.soles is other.soles
    assert one.source.motion is not other.source.motion


def test_a_body_whose_rest_pose_does_not_stand_has_no_rig():
    skeleton = rig("mixamo", "T")
    along_x = skeleton.with_offsets(np.outer(skeleton.lengths, [1.0, 0.0, 0.0]))
    body = Body.of_motion(swaying(along_x))
    assert not body.stands_at_rest
    assert body.rig is None
    assert match(body, Body.of(skeleton)).rig is None


@pytest.mark.parametrize("target", [rig("mixamo", "T"), HERO], ids=["skeleton", "character"])
def test_results_do_not_depend_on_the_clips_before(target):
    """Sources that differ only in their offsets, or only in how they move, in any order."""
    target = load_target(target) if target is HERO else target
    clap = sample("clap")
    uneven = clap.skeleton.offsets * np.linspace(0.9, 1.1, len(clap.skeleton))[:, None]
    sources = [clap[:8], clap.scaled(0.9)[:8], replace(clap, skeleton=clap.skeleton.with_offsets(uneven))[:8]]
    sources += [clap[9:12], sample("walk")[:8]]
    first = [of_result(retarget(source, target)) for source in sources]
    assert [of_result(retarget(source, target)) for source in reversed(sources)] == first[::-1]


def test_clips_may_be_retargeted_side_by_side():
    sources = [sample(name)[:4] for name in ("clap", "walk", "squat")] * 2
    target = sample_target("hero")
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda source: of_result(retarget(source, target)), sources))
    assert found == [of_result(retarget(source, target)) for source in sources]


@pytest.mark.parametrize("stands", [True, False])
def test_no_motion_is_kept(stands):
    skeleton, target = rig("mixamo", "T"), sample_target("hero")
    if not stands:
        skeleton = skeleton.with_offsets(np.outer(skeleton.lengths, [1.0, 0.0, 0.0]))
    motions = []
    for seed in range(3):
        source = swaying(skeleton, frames=3, seed=seed)
        result = retarget(source, target)
        assert result.metrics
        motions += map(weakref.ref, (source, result, result.source, result.motion, result.rotation_copy))
    del source, result
    gc.collect()
    assert not any(motion() for motion in motions)


def test_only_the_rigs_used_last_are_kept():
    target, rigs = rig("mixamo", "T"), []
    for n in range(3 * CACHED_RIGS):
        result = retarget(swaying(longer(target, 1.0 + 0.01 * n), frames=2), target)
        assert result.metrics
        rigs += map(weakref.ref, (result.matching.source.rig, result.matching.rig))
    del result
    gc.collect()
    assert sum(each() is not None for each in rigs) <= 2 * 2 * CACHED_RIGS
    assert rigs[-1]() is not None


def test_a_function_is_called_again_for_what_has_no_rig():
    calls = []

    @rig_cached
    def name(body, end):
        calls.append(body)
        return f"{len(body.skeleton)}{end}"

    still, moving = Body.of(rig("mixamo", "T")), Body.of_motion(swaying(rig("mixamo", "T")))
    assert name(still, "a") == name(moving, "a") == name(moving, "a")
    assert calls == [still.rig]
    unknown = Body(moving.skeleton, None, moving.motion)
    assert name(unknown, "a") == name(unknown, "a") == name(still, "a")
    assert calls[1:] == [unknown, unknown]
