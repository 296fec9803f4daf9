"""Statements of the dissertation, the studies that decide them, verdicts, and the front page."""
