"""Calls of rerun that several testbeds share."""
