"""What is done with a learned task, and how it is scored."""
