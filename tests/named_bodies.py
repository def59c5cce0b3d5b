"""Bodies given by the names and the tree of their joints, and the published names of conventions."""

import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from bodies import tree_of
from character_rigs import Rig

from distretarget.body.recognition import by_names

NAMES = Path(__file__).resolve().parents[2] / "shared" / "joint_names.json"
DATA = json.loads(NAMES.read_text("utf-8")) if NAMES.is_file() else {"_roles": {}}
needs_names = pytest.mark.skipif(not NAMES.is_file(), reason="the published names are not here")

# Joints are nested by parentheses, follow each other down with ">" and stand side by side with "|".
PLAIN = Rig(
    "Hips=hips(Spine=spine>Spine1=chest>Spine2=upperChest(Neck=neck>Head=head|{@Shoulder=Shoulder>@Arm=UpperArm>"
    "@ForeArm=LowerArm>@Hand=Hand})|{@UpLeg=UpperLeg>@Leg=LowerLeg>@Foot=Foot>@ToeBase=Toes})",
    ("Left", "Right"),
)
BODY, ROLES = PLAIN.text, {role: name for role, (name,) in PLAIN.roles.items()}


def skeleton(names, parents, ends=()):
    return tree_of(np.zeros((len(names), 3)), names, parents, ends)


def tree(text):
    names, parents, above, joint = [], [], [], -1
    for token in re.findall(r"[()|]|[^()|>]+", text):
        if token == "(":
            above.append(joint)
        elif token == ")":
            joint = above.pop()
        elif token == "|":
            joint = above[-1]
        else:
            parents.append(joint)
            joint = len(names)
            names.append(token)
    return skeleton(names, parents)


def roles(body):
    anatomy = by_names(body)
    return {role: body.keys[joint] for role, joint in anatomy.roles.items()}


@cache
def published(convention):
    """The joints of a convention, all at one place."""
    joints = DATA[convention]
    names = [joint["name"] for joint in joints]
    return skeleton(names, [names.index(joint["parent"]) if joint["parent"] else -1 for joint in joints])
