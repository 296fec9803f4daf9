"""Logs of robot arms: identification of their dynamics."""
