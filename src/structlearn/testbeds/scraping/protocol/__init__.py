"""What is run on the board, and how it is scored."""
