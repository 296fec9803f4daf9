"""The page of the dynamics testbed."""
