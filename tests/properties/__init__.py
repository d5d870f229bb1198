"""Properties that every run has, whatever the puppet and whatever its inputs ask for."""
