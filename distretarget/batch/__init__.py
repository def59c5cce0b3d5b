"""Many clips onto one or several targets: a folder in, a folder out, and a manifest that tells what was done."""
