"""The skin of a body: its mesh, and the tapered capsules that stand for it in the solver."""
