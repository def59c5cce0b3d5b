"""Numbers that know no body: rotations, Euler angles, shots, smoothing over time, the stress of a posture."""
