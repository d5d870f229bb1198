"""Section VI of the paper, measured."""
