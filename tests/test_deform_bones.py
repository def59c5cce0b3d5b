"""The tree of the bones that deform, in rigs with three copies of each bone."""

import pytest
from named_bodies import roles, skeleton, tree

from distretarget.character.character import deform_tree

# As Rigify builds it: the spine hangs from the root, everything else from the originals.
GENERATED = (
    "rig(root>DEF-spine>DEF-spine.001>DEF-spine.002>DEF-spine.003>DEF-spine.004>DEF-spine.005>DEF-spine.006|torso("
    "hips|chest|MCH-spine.001>spine_fk.001>tweak_spine.001>ORG-spine.001|spine_fk>ORG-spine(ORG-pelvis.L>DEF-pelvis.L|"
    "DEF-thigh.L>DEF-thigh.L.001>DEF-shin.L>DEF-shin.L.001>DEF-foot.L>DEF-toe.L|ORG-thigh.L>ORG-shin.L>ORG-foot.L|"
    "DEF-thigh.R>DEF-thigh.R.001>DEF-shin.R>DEF-shin.R.001>DEF-foot.R>DEF-toe.R|ORG-thigh.R>ORG-shin.R)|"
    "MCH-spine.002>spine_fk.003>ORG-spine.003(MCH-ROT-head>head>ORG-spine.006>ORG-face>jaw_master>DEF-jaw|"
    "ORG-shoulder.L(DEF-shoulder.L|DEF-upper_arm.L>DEF-upper_arm.L.001>DEF-forearm.L>DEF-forearm.L.001>DEF-hand.L>"
    "ORG-palm.01.L(DEF-palm.01.L|DEF-f_index.01.L>DEF-f_index.02.L|f_index.01.L))|"
    "ORG-shoulder.R(DEF-shoulder.R|DEF-upper_arm.R>DEF-upper_arm.R.001>DEF-forearm.R>DEF-forearm.R.001>DEF-hand.R))))"
)


# The same as Blender writes it if only the bones that deform are asked for.
ALONE = (
    "rig(DEF-spine>DEF-spine.001>DEF-spine.002>DEF-spine.003>DEF-spine.004>DEF-spine.005>DEF-spine.006|DEF-pelvis.L|"
    "DEF-thigh.L>DEF-thigh.L.001>DEF-shin.L>DEF-shin.L.001>DEF-foot.L>DEF-toe.L|DEF-jaw|DEF-lid.B.L.001|DEF-brow.T.L|"
    "DEF-thigh.R>DEF-thigh.R.001>DEF-shin.R>DEF-shin.R.001>DEF-foot.R>DEF-toe.R|DEF-shoulder.L|DEF-shoulder.R|"
    "DEF-upper_arm.L>DEF-upper_arm.L.001>DEF-forearm.L>DEF-forearm.L.001>DEF-hand.L(DEF-palm.01.L|"
    "DEF-f_index.01.L>DEF-f_index.02.L)|"
    "DEF-upper_arm.R>DEF-upper_arm.R.001>DEF-forearm.R>DEF-forearm.R.001>DEF-hand.R)"
)


def deforming(text, rename=lambda name: name):
    """The tree of the bones that deform as a skeleton."""
    body = tree(text)
    names = [rename(name) for name in body.names]
    found = deform_tree(names, body.parents.tolist())
    bones = []
    while len(bones) < len(found):
        bones += [bone for bone in found if bone not in bones and found[bone] in (-1, *bones)]
    return skeleton([names[bone] for bone in bones], [bones.index(found[b]) if found[b] >= 0 else -1 for b in bones])


@pytest.mark.parametrize(
    ("text", "rename"),
    [
        (GENERATED, str),
        (GENERATED, lambda name: name.replace(".", "")),
        (GENERATED, lambda name: f"{name}_0{len(name)}"),
        (ALONE, str),
        (ALONE, lambda name: f"{name}_0{len(name)}"),
    ],
)
def test_bones_that_deform_hang_from_each_other_as_their_originals_do(text, rename):
    body = deforming(text, rename)
    above = {name: body.names[parent] for name, parent in zip(body.names, body.parents, strict=True) if parent >= 0}
    expected = {
        "DEF-thigh.L": "DEF-spine",
        "DEF-pelvis.L": "DEF-spine",
        "DEF-shoulder.L": "DEF-spine.003",
        "DEF-upper_arm.L": "DEF-shoulder.L",
        "DEF-upper_arm.L.001": "DEF-upper_arm.L",
        "DEF-palm.01.L": "DEF-hand.L",
        "DEF-f_index.01.L": "DEF-palm.01.L" if text == GENERATED else "DEF-hand.L",
        "DEF-jaw": "DEF-spine.006",
    }
    assert {rename(name): above[rename(name)] for name in expected} == {
        rename(name): rename(parent) for name, parent in expected.items()
    }
    assert body.names[0] == rename("DEF-spine")
    assert all(name.startswith("DEF-") for name in body.names)
    found = roles(body)
    assert (found["hips"], found["head"]) == (rename("DEF-spine"), rename("DEF-spine.006"))
    assert found["leftLowerArm"] == rename("DEF-forearm.L")
    assert found["leftIndex1"] == rename("DEF-f_index.01.L")


@pytest.mark.parametrize(
    "text",
    [
        "Hips>Spine>Head",
        "root>DEF-spine(DEF-spine.001|DEF-thigh.L>DEF-shin.L)",
        "root(DEF-box>DEF-lid|DEF-wheel.L|DEF-wheel.R)",
        GENERATED.replace("DEF-", "my_"),
    ],
)
def test_a_tree_that_shows_it_already_stays(text):
    body = tree(text)
    assert deform_tree(body.names, body.parents.tolist()) == {}


def test_where_all_bones_are_joints_hands_are_those_that_deform():
    found = roles(tree(GENERATED))
    assert (found["leftHand"], found["leftIndex1"]) == ("DEF-hand.L", "DEF-f_index.01.L")


def test_controls_are_left_out_also_where_the_bones_that_deform_hang_together():
    body = tree("root(DEF-spine(DEF-spine.001|DEF-thigh.L)|torso(ORG-spine|spine_fk|thigh_fk.L|head))")
    found = deform_tree(body.names, body.parents.tolist())
    assert {body.names[bone]: body.names[parent] for bone, parent in found.items() if parent >= 0} == {
        "DEF-spine.001": "DEF-spine",
        "DEF-thigh.L": "DEF-spine",
    }
