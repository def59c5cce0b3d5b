"""How good a motion is: metrics against the source, and two motions against each other."""
