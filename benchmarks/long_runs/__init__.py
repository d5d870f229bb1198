"""Measures the variational integrator beside the other methods: energy, order, momenta, cost."""
