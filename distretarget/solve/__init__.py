"""The objectives, and the solver that minimises them over the rotations of exact bones."""
