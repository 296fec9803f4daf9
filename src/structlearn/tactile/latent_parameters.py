"""What is chosen for the training of latent spaces and their dynamics, and for the distances on the skin."""

from pydantic import Field, PositiveInt

from structlearn.ground.params import Parameters


class NetworkParameters(Parameters):
    """Sizes of the networks (II.4.1.3). Fields: `params.yaml`, `train_latent.networks`."""

    encoder_hidden: tuple[PositiveInt, ...]
    locally_linear_hidden: tuple[PositiveInt, ...]
    nonlinear_hidden: PositiveInt


class LossWeights(Parameters):
    """Weights of the losses (eq. II.23, II.24), for quantities in the units of `TouchUnits`.

    Fields: `params.yaml`, `train_latent.training.weights`.
    """

    reconstruction: float = Field(ge=0)
    distances: float = Field(ge=0)
    pressure: float = Field(ge=0)
    forward: float = Field(ge=0)
    inverse: float = Field(ge=0)


class LatentTrainingParameters(Parameters):
    """How latent spaces and dynamics are trained. Fields: `params.yaml`, `train_latent.training`."""

    steps: PositiveInt
    batch_size: PositiveInt
    learning_rate: float = Field(gt=0)
    decay: float = Field(gt=0, lt=1)
    weights: LossWeights
    action_penalty: float = Field(gt=0)
    evaluate_every: PositiveInt
    seed: int = Field(ge=0)


class LatentParameters(Parameters):
    """What is trained, and how it is compared."""

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
    """How latent spaces are learned from a small set. Fields: `params.yaml`, `train_latent`."""

    seeds: PositiveInt
    networks: NetworkParameters
    training: LatentTrainingParameters
    pair_pool: int = Field(ge=1)
    evaluation_pairs: int = Field(ge=1)


class GeodesicParameters(Parameters):
    """The neighbour graph."""

    neighbours: int = Field(ge=2)
    bin_size: int = Field(ge=3)
    bins: int | None = Field(ge=1)
    bridge_mm: float = Field(ge=0)
    seed: int = Field(ge=0)
