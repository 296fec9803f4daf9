"""Executions on the board: protocols and scores."""
