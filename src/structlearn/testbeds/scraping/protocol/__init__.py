"""Executions on the board, and their scores."""
