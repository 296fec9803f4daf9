"""The page on rivals, and a recording of all methods side by side."""
