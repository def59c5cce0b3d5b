"""Numerics without knowledge of bodies: rotations, kinematics of trees, Euler angles, smoothing, shots; compilation."""
