"""Files: BVH, target skeletons and joint maps, read with their faults named and written whole or not at all."""
