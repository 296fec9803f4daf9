"""Positions of obstacles, and simulated people reaching around them."""
