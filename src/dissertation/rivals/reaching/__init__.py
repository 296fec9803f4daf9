"""The same rivals on reaches past spheres, beside the learned avoidance."""
