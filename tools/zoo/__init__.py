"""The zoo: bodies of many shapes, with every trait that rigs of people have been seen to have.

`member("mouse")` is the skeleton of one body, `MEMBERS` the table of all. Every call gives the same skeleton.
"""

from zoo.members import MEMBERS, Member, member, skeleton_of

__all__ = ["MEMBERS", "Member", "member", "skeleton_of"]
