"""The page of the obstacle testbed."""
