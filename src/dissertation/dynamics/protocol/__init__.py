"""Training and tracking protocols of the dynamics testbed."""
