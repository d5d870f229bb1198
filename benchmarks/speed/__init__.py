"""The measured report on speed: ``python -m benchmarks.speed`` writes docs/benchmarks.md.

The same puppet goes to every peer, and before anything is timed its motion is compared with ours.
What is compared is timed in turns, so that a busy neighbour slows both sides, and ratios are taken
turn by turn.
"""
