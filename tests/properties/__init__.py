"""Properties of every run, for any puppet and any inputs."""
