"""How good a motion is: figures against the source, and two motions against each other."""
