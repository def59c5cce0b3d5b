"""A body: its skeleton, the parts that its joints play, its legs and axes, and its reference pose."""
