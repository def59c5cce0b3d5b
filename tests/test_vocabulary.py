"""The words of the naming conventions."""

from distretarget.body.anatomy import ARM, LEG
from distretarget.body.conventions import vocabulary


def test_words_of_the_data_make_no_convention_twice():
    conventions = vocabulary().conventions
    names = {(convention.title, frozenset(convention.parts)) for convention in conventions}
    assert len(names) == len(conventions)  # a title may stand for several generations of a rig
    assert all({"hips", "head", *ARM[1:], *LEG[:3]} <= set(convention.parts.values()) for convention in conventions)
