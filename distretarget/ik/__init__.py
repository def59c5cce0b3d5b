"""Inverse kinematics on exact bones: springs on an articulated body, solved by a spectral gradient method."""
