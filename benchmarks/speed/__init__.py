"""The measured report on speed: ``python -m benchmarks.speed`` writes docs/benchmarks.md.

Every peer simulates the same puppet; its motion is compared with ours before anything is timed.
Compared programs are timed in turns, so that other load slows both sides, and ratios are taken
turn by turn.
"""
