"""The rigs that characters come with: every part of the body by name, among twist, face, hair and cloth bones."""

import pytest
from character_rigs import RIGS
from named_bodies import tree

from distretarget.body.recognition import by_names


@pytest.mark.parametrize("name", RIGS)
def test_every_part_is_found_and_nothing_else(name):
    rig = RIGS[name]
    body = tree(rig.text)
    anatomy = by_names(body)
    limbs = {role: body.names[joint] for role, joint in anatomy.roles.items() if role.startswith(("left", "right"))}
    assert limbs == rig.role_names()
    assert [body.names[joint] for joint in anatomy.spine] == [*rig.spine]
    assert [body.names[joint] for joint in anatomy.neck] == [*rig.neck]
    assert [body.names[anatomy.roles[role]] for role in ("hips", "head")] == [rig.hips, rig.head]
    assert anatomy.convention == rig.title
