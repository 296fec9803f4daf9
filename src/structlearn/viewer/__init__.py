"""Every call of rerun that two testbeds or more make."""
