"""Training of feed-forward networks of deviations, phase and phase velocity; see `ffnn`."""

from functools import partial

from structlearn.feedback.models.ffnn_phase import PhaseFeedForwardNetwork
from structlearn.feedback.training import ffnn

train = partial(ffnn.train, model=PhaseFeedForwardNetwork)
