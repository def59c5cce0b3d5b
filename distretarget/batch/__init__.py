"""Many clips onto one or several targets: a folder in, a folder out, and a manifest of what was done."""
