"""Feed-forward network of deviations, phase and phase velocity (IV.9.3.3)."""

from structlearn.feedback.models.ffnn import FeedForwardNetwork


class PhaseFeedForwardNetwork(FeedForwardNetwork):
    """A trained feed-forward network with inputs [ds, p, u]."""

    phases = 2
