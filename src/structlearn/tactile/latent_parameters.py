"""What is chosen for the training of latent spaces and their dynamics, and for the distances on the skin."""

from pydantic import Field, PositiveInt

from structlearn.ground.params import Parameters


class NetworkParameters(Parameters):
    """Sizes of the networks (II.4.1.3).

    Attributes:
        encoder_hidden: nodes of the encoder's hidden layers; the decoder mirrors them.
        locally_linear_hidden: nodes of the hidden layers of the LL model.
        nonlinear_hidden: nodes of the hidden layer of the NL model.
    """

    encoder_hidden: tuple[PositiveInt, ...]
    locally_linear_hidden: tuple[PositiveInt, ...]
    nonlinear_hidden: PositiveInt


class LossWeights(Parameters):
    """Weights of the losses (eq. II.23, II.24), for quantities in the units of `TouchUnits`.

    Attributes:
        reconstruction: w_AER.
        distances: w_MDS.
        pressure: w_CDP.
        forward: w_LFD.
        inverse: w_ID.
    """

    reconstruction: float = Field(ge=0)
    distances: float = Field(ge=0)
    pressure: float = Field(ge=0)
    forward: float = Field(ge=0)
    inverse: float = Field(ge=0)


class LatentTrainingParameters(Parameters):
    """How latent spaces and dynamics are trained.

    Attributes:
        steps: of both optimisers.
        batch_size: pairs of samples, and chains, per model and step.
        learning_rate: of RMSProp at the start; it falls to zero.
        decay: of RMSProp's running mean of squared gradients.
        weights: of the losses.
        action_penalty: beta of the inverse models (eq. II.12), in the units of `TouchUnits`.
        evaluate_every: steps between two points of the learning curve.
        seed: of initial weights and batches.
    """

    steps: PositiveInt
    batch_size: PositiveInt
    learning_rate: float = Field(gt=0)
    decay: float = Field(gt=0, lt=1)
    weights: LossWeights
    action_penalty: float = Field(gt=0)
    evaluate_every: PositiveInt
    seed: int = Field(ge=0)


class LatentParameters(Parameters):
    """What is trained, and how it is compared.

    Attributes:
        seeds: of the latent spaces with and without structure, and their dynamics.
        stacks: the seeds train in so many processes.
        starts: draws of initial weights of the autoencoders, of which the best is trained.
        start_steps: of training, after which starts are compared.
        map_unit_m: m on the skin per unit of the latent map; the losses then are of comparable size.
        networks: sizes.
        training: of all of them.
        pair_pool: pairs of samples from which the batches are drawn.
        evaluation_pairs: pairs per split on which map and geodesic distances are compared (II.4.3).
        longest_chain: steps of prediction to which the forward models are tested.
    """

    seeds: PositiveInt
    stacks: PositiveInt
    starts: PositiveInt
    start_steps: PositiveInt
    map_unit_m: float = Field(gt=0)
    networks: NetworkParameters
    training: LatentTrainingParameters
    pair_pool: PositiveInt
    evaluation_pairs: PositiveInt
    longest_chain: int = Field(ge=3)


class LatentSpaceParameters(Parameters):
    """How latent spaces are learned from a small set.

    Attributes:
        seeds: of the latent spaces with and without structure; all are one stack.
        networks: sizes; the dynamics are not trained.
        training: of the autoencoders.
        pair_pool: pairs of samples from which the batches are drawn.
        evaluation_pairs: pairs on which map and geodesic distances are compared.
    """

    seeds: PositiveInt
    networks: NetworkParameters
    training: LatentTrainingParameters
    pair_pool: int = Field(ge=1)
    evaluation_pairs: int = Field(ge=1)


class GeodesicParameters(Parameters):
    """The neighbour graph.

    Attributes:
        neighbours: M nearest neighbours of every point.
        bin_size: N' points per bin.
        bins: at most so many bins; None: as many as the samples fill.
        bridge_mm: gap between two patches of points that may be bridged by its shortest edge; a wider one is
            an error.
        seed: of the bins.
    """

    neighbours: int = Field(ge=2)
    bin_size: int = Field(ge=3)
    bins: int | None = Field(ge=1)
    bridge_mm: float = Field(ge=0)
    seed: int = Field(ge=0)
