"""Measures strings as chains of masses and springs beside the massless constraint."""
