"""Sections of the page of a task."""
