"""Ordinary network of deviations, phase and phase velocity: the rival with phase inputs (IV.9.3.3)."""

from structlearn.feedback.models.ffnn import FeedForwardNetwork


class PhaseFeedForwardNetwork(FeedForwardNetwork):
    """Its inputs are [ds, p, u]."""

    phases = 2
