"""Obstacle avoidance: reaches round spheres, cubes and cylinders, and feedback models learned from them."""
