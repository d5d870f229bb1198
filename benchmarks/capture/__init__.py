"""Motion capture: clips to follow."""
