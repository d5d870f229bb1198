"""Imported models against their own programs."""
