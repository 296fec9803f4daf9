"""Obstacle scenarios, and simulated people who reach past them."""
