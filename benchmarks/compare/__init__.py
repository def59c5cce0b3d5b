"""Benchmarks that asv compares between commits."""
