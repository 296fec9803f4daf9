"""The recordings of the dynamics testbed."""
