"""rerun recordings: calls shared by several testbeds."""
