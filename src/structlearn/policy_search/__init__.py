"""Path integral policy improvement, and the refinement of feedback models with it (IV.7)."""
