"""Plays: who does what, where and when on a stage, compiled and verified."""
