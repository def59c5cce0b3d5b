"""Performers and props in one world: what touches between them, and the sweeps that keep these contacts."""
