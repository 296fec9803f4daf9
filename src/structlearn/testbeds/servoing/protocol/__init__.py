"""Closed-loop trials of controllers, and their scores."""
