"""A body: its skeleton, which joint plays which part, its legs and axes, and a posture in which it stands."""
