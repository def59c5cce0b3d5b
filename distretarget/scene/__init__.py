"""Performers and props in one world: the contacts between them, and the sweeps that keep these."""
