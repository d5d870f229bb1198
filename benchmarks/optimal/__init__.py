"""Benchmarks of optimal control."""
