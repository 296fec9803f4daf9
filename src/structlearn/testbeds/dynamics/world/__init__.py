"""The simulated arms and their motions."""
