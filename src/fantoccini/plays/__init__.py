"""Plays: several puppets perform what a text says, and walk past each other."""
