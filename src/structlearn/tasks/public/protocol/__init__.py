"""What is asked of each method on recorded data."""
