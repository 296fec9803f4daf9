"""Training of feed-forward networks by RMSProp, all jobs as one stack (IV.9.3.3)."""

from torch import Tensor

from structlearn.feedback.coupling_model import CouplingModel
from structlearn.feedback.models.ffnn import FeedForwardNetwork
from structlearn.feedback.supervised_training import Stack, scaled_targets, standardised, train_stack
from structlearn.feedback.trainers import Jobs, Nodes, Trained, TrainingParameters
from structlearn.networks.stacked_layers import Dropout, RowLayers
from structlearn.networks.torch_settings import seeded


def train(
    jobs: Jobs,
    parameters: TrainingParameters,
    hidden: Nodes = (),
    initial: CouplingModel | None = None,
    model: type[FeedForwardNetwork] = FeedForwardNetwork,
) -> list[Trained[FeedForwardNetwork]]:
    """Train one network per job, always from scratch; see `trainers.Trainer`."""
    units, inputs = standardised(jobs, model.phases)
    scales, data = scaled_targets(jobs, inputs, None)
    generator = seeded(parameters.seed)
    stacked = RowLayers.initial(len(jobs), (inputs.shape[2], *hidden, 1), generator)
    dropout = Dropout(parameters.dropout, generator)

    def forward(inputs: Tensor, modulation: None, training: bool) -> Tensor:
        return stacked.forward(inputs, training, dropout).squeeze(-1)

    def network(index: int) -> FeedForwardNetwork:
        *before, (weights, biases) = stacked.layers_of(index)
        last = (weights * scales[index], biases * scales[index])
        return model(*units[index], (*before, last))

    return train_stack(Stack(stacked.parameters(), forward), data, parameters, network)
