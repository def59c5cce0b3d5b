"""One clip from source and target to a result."""
