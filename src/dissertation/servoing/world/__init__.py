"""Closed-loop simulation of the finger."""
