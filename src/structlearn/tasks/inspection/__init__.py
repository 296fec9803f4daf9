"""What recordings hold, whether they are fit to be learned from, and an entry for them."""
