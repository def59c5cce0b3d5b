"""A body: its skeleton, the parts its joints play, its legs, soles, regions and axes, and its reference pose."""
