"""Bodies whose names show some limbs and whose shape shows the others."""

from dataclasses import replace

import pytest
from bodies import SAMPLES

from distretarget.body.anatomy import FINGERS
from distretarget.body.body import Body
from distretarget.body.recognition import by_names
from distretarget.io.target_file import load_target

RIGS = {path.stem: load_target(path).skeleton for path in sorted((SAMPLES / "rigs").glob("*_t.json"))}
LIMBS = {"arms": ("Shoulder", "UpperArm", "LowerArm", "Hand"), "legs": ("UpperLeg", "LowerLeg", "Foot", "Toes")}


def unnamed(body, roles):
    """The body whose joints of these roles have names that mean nothing."""
    joints = {by_names(body).roles[role] for role in roles if role in by_names(body).roles}
    return replace(body, names=tuple(f"b{j}" if j in joints else name for j, name in enumerate(body.names)))


@pytest.mark.parametrize("sides", [("left", "right"), ("left",), ("right",)])
@pytest.mark.parametrize("limbs", LIMBS)
@pytest.mark.parametrize("name", RIGS)
def test_limbs_without_names_are_found_by_shape(name, limbs, sides):
    body = RIGS[name]
    whole = Body.of(body).anatomy
    lost = unnamed(body, [side + part for side in sides for part in LIMBS[limbs]])
    found = Body.of(lost).anatomy
    long = [side + part for side in ("left", "right") for part in ("UpperArm", "LowerArm", "UpperLeg", "LowerLeg")]
    assert {role: found.roles[role] for role in long} == {role: whole.roles[role] for role in long}
    assert (found.spine, found.method) == (whole.spine, "shape")


def test_names_alone_count_where_they_show_all_limbs():
    for body in RIGS.values():
        assert Body.of(body).anatomy is by_names(body)


@pytest.mark.parametrize(
    "words",
    [
        ("Daumen", "Zeigefinger", "Mittelfinger", "Ringfinger", "KleinerFinger"),
        ("Pulgar", "Índice", "Medio", "Anular", "Meñique"),
        ("Pouce", "Index", "Majeur", "Annulaire", "Auriculaire"),
        ("拇指", "食指", "中指", "无名指", "小指"),
    ],
    ids=["German", "Spanish", "French", "Chinese"],
)
def test_names_show_the_fingers_of_a_body_that_its_shape_shows(words):
    body = RIGS["mixamo_t"]
    fingers = {role: joint for role, joint in by_names(body).roles.items() if role[-1].isdigit()}
    names = [f"b{joint}" for joint in range(len(body))]
    for role, joint in fingers.items():
        side = "left" if role.startswith("left") else "right"
        finger = FINGERS.index(role.removeprefix(side)[:-1])
        names[joint] = f"{words[finger]}{role[-1]}_{side[0].upper()}"
    found = Body.of(replace(body, names=tuple(names))).anatomy
    assert found.method == "shape"
    assert {role: found.roles.get(role) for role in fingers} == fingers
