"""Retarget BVH motion to another body by normalised joint distances."""
