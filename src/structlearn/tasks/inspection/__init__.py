"""Inspection of recordings: their content, their fitness for learning, and a proposed task entry."""
