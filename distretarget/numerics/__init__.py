"""Numbers that know no body: rotations, Euler angles, smoothing over time, the stress of a posture."""
