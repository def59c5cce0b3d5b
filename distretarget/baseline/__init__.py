"""The baseline, called rotation copy: the source's rotations on the target's bones, in the target's world; and what is
placed after solving, a root on the floor and IK handles.
"""
