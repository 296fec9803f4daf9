"""The page of a task of your own."""
