"""Files as people have them: a motion in another structure gives the same result as in the plain one, or is refused."""

import numpy as np
import pytest
from built_rigs import BUILDS, with_axes
from disguises import DISGUISES, beside, farthest_apart, off, on_high_ankles, plain, sample, straight_below, targets
from scipy.spatial.transform import Rotation

from distretarget import Body, retarget

pytestmark = pytest.mark.parametrize("disguise", DISGUISES, ids=repr)


@pytest.mark.parametrize("clip", ["walk", "clap"])
@pytest.mark.parametrize("parts", [("Ankle",), ("Wrist",), ("Ankle", "Wrist")])
def test_feet_and_hands_that_hang_from_the_root_are_those_of_the_body(disguise, parts, clip, tmp_path):
    for target in targets():
        assert off(beside(*parts), disguise, clip, tmp_path, target) < 0.01


@pytest.mark.parametrize("clip", ["walk", "squat"])
def test_feet_beside_the_body_of_a_target_are_where_its_legs_end(disguise, clip, tmp_path):
    usual, other = (disguise.target(structure, tmp_path) for structure in (plain, beside("Ankle")))
    results = [retarget(sample(clip), target) for target in (usual, other)]
    assert farthest_apart(*(result.motion for result in results)) < 0.01
    assert results[1].warnings == results[0].warnings
    skeleton = results[1].motion.skeleton
    if not disguise.gltf:
        assert skeleton == other.skeleton
        assert 0 in skeleton.parents[[skeleton.index(disguise.by_sample["LeftAnkle"])]]


@pytest.mark.parametrize("build", [None, *BUILDS])
def test_a_joint_straight_below_the_ankle_is_no_toe(disguise, build):
    """Feet point as their tips do, whatever a joint below the ankle shows and however the joints are built."""
    high, straight = on_high_ankles(sample("squat")), straight_below(sample("squat"))
    if build:
        axes = build(Body.of_motion(high))
        high, straight = with_axes(high, axes), with_axes(straight, axes)
    for target in targets():
        motions = [retarget(disguise.worn(each), target).motion for each in (high, straight)]
        ankles = [target.index(name) for name in target.names if name.endswith(("Ankle", "Foot"))]
        for ankle in ankles:
            one, other = (Rotation.from_quat(motion.world_rotations_of(ankle)) for motion in motions)
            assert np.degrees((one.inv() * other).magnitude()).max() < 3.0
