"""What avoidance models are learned from and put to, and how they are scored."""
