"""The simulated finger in closed loop."""
