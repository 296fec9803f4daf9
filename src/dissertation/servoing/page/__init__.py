"""The page of the servoing testbed."""
