"""The baseline, called rotation copy: the source's rotations on the target's bones, in the target's world."""
