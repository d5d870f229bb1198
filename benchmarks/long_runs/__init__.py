"""Measures the variational integrator against other methods: energy, order, momenta, cost."""
