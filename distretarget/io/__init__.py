"""Files: BVH, glTF, VRM, FBX, skeletons and joint maps. Errors name the place of a fault; files are written whole."""
