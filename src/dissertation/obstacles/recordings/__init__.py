"""The recordings of the obstacle testbed."""
