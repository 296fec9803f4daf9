"""The pages of the recorded data."""
