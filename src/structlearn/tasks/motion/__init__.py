"""Logs of a robot arm: identification of its dynamics."""
