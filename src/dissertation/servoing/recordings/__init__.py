"""The recordings of the servoing testbed."""
