"""Many clips onto one or several targets: folders of results, each with a manifest of what was done."""
