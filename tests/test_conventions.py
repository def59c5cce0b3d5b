"""Naming conventions, recognised by the names of joints."""

import pytest
from named_bodies import needs_names, published

from distretarget.body.conventions import convention_of
from distretarget.body.named_anatomy import by_names


@needs_names
@pytest.mark.parametrize(
    ("convention", "title"),
    [
        ("mixamo", "Mixamo"),
        ("humanik_motionbuilder", "HumanIK (MotionBuilder)"),
        ("rokoko_bvh_export", "Rokoko"),
        ("rokoko_newton", "Rokoko Newton"),
        ("lafan1", "LAFAN1"),
        ("perception_neuron_axis", "Perception Neuron"),
        ("cmu_motionbuilder", "CMU, MotionBuilder-friendly"),
        ("cmu_maxfriendly", "CMU, 3ds Max-friendly"),
        ("cmu_daz_friendly", "CMU, Daz-friendly"),
        ("second_life", "Poser, Second Life"),
        ("daz_genesis8", "Daz Genesis 3, 8"),
        ("xsens_mvn", "Xsens MVN"),
        ("bandai_namco", "Bandai Namco"),
        ("vrm_humanoid_1_0", "VRM"),
        ("smpl", "SMPL"),
        ("smplx", "SMPL"),
        ("smpl_bvh_fbx_names", "SMPL"),
        ("unreal_mannequin_ue4", "Unreal Engine 4"),
        ("unreal_mannequin_ue5", "Unreal Engine 5"),
        ("biped_3dsmax", "3ds Max Biped"),
        ("character_creator", "Character Creator"),
        ("vicon_blade", "Vicon Blade"),
        ("makehuman_default", "MakeHuman"),
        ("makehuman_cmu", "MakeHuman, CMU"),
    ],
)
def test_the_convention_is_recognised(convention, title):
    body = published(convention)
    assert convention_of(body) == by_names(body).convention == title
