"""The studio: a local page on which a clip and a character are dropped, seen, changed and taken away."""
