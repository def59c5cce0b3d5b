"""Retarget a folder of clips to one skeleton, and save arrays of each for training; metrics.csv has their metrics.

python examples/data_set.py CLIPS TARGET ARRAYS
"""

import sys

from distretarget import OutputSettings, Recipe, convert_folder

if __name__ == "__main__":
    clips, target, arrays = sys.argv[1:]
    recipe = Recipe(writing=OutputSettings(rotations="6d", precision="float32"))
    tally = convert_folder(clips, target, arrays, formats=["npz"], recipe=recipe)
    print("\n".join(tally.lines))
