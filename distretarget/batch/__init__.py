"""Many clips onto one or several targets: folders of results, each with a database of what was done."""
