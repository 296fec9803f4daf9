"""Sets of touches tried on each other and on simulated touch."""
