"""Simulated arms and their motions."""
