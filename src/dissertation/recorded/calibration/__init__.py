"""Simulated beside recorded touch."""
