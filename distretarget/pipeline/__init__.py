"""Retargeting of one clip, from source and target to a result."""
