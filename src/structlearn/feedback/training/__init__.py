"""Trainers of feedback networks, one per module: a function `train`, see `feedback.trainers.Trainer`."""
