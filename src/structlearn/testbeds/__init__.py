"""What belongs to one testbed alone; no testbed imports another."""
