"""Training, test situations and scores of avoidance models."""
