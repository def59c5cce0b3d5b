"""Files: BVH, target skeletons and joint maps. Errors name the place of a fault; files are written whole or not."""
