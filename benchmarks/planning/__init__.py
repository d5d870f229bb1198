"""Benchmarks of planning: time and quality of plans, and their success in other simulations."""
