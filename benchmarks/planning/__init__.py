"""How fast plans are found, how good they are, and whether they hold elsewhere."""
