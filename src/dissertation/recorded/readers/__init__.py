"""Readers of public sets, one module per set."""
