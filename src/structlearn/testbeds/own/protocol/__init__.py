"""What is asked of somebody's own recordings."""
