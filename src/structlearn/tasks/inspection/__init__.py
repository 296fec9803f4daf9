"""Inspection of recordings: contents, fitness for learning, and a proposed task entry."""
