"""Dynamics learning of an arm (chapter III)."""
