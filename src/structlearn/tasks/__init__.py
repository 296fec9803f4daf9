"""Tasks: recorded data, public or a lab's own, with one protocol per kind of data."""
