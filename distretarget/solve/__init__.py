"""Solve for the target's motion: the objectives, and the solver that minimises them over rotations on exact bones."""
