"""Measures strings as chains of masses and springs, compared with the massless constraint."""
