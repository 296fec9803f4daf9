"""Parameters of latent spaces, their dynamics and geodesics; names of the compared models."""

from typing import Final, Literal

from pydantic import Field, PositiveInt

from structlearn.core.params import Parameters

LATENT = 3  # dimensions of the latent state: map x, map y, pressure
MAP = 2  # dimensions of the map among them
STRUCTURES = (True, False)  # whether the loss of the latent space contains L_MDS and L_CDP

InverseModel = Literal["LL", "NG", "NJ"]

LOCALLY_LINEAR: InverseModel = "LL"
NEGATIVE_GRADIENT: InverseModel = "NG"
JACOBIAN: InverseModel = "NJ"
NONLINEAR = "NL"  # forward model, besides `LOCALLY_LINEAR`
UNCHANGED = "unchanged"  # prediction of no motion, for comparison
NO_INVERSE: Final = "none"  # trained with L_LFD alone

# inverse models whose loss L_ID each forward model is trained with, in the order of its stack
TRAINED_WITH: dict[str, tuple[InverseModel | Literal["none"], ...]] = {
    LOCALLY_LINEAR: (NO_INVERSE, LOCALLY_LINEAR),
    NONLINEAR: (NO_INVERSE, NEGATIVE_GRADIENT, JACOBIAN),
}
# forward model whose parameters each inverse model uses
FORWARD_OF: dict[InverseModel, str] = {
    LOCALLY_LINEAR: LOCALLY_LINEAR,
    NEGATIVE_GRADIENT: NONLINEAR,
    JACOBIAN: NONLINEAR,
}


class LatentNetworkParameters(Parameters):
    """Layer sizes of the networks (II.4.1.3)."""

    encoder_hidden: tuple[PositiveInt, ...]
    locally_linear_hidden: tuple[PositiveInt, ...]
    nonlinear_hidden: PositiveInt


class LossWeights(Parameters):
    """Weights of the losses (eq. II.23, II.24), for quantities in the units of `TouchUnits`."""

    reconstruction: float = Field(ge=0)
    distances: float = Field(ge=0)
    pressure: float = Field(ge=0)
    forward: float = Field(ge=0)
    inverse: float = Field(ge=0)


class LatentTrainingParameters(Parameters):
    """Training of latent spaces and dynamics."""

    steps: PositiveInt
    batch_size: PositiveInt
    learning_rate: float = Field(gt=0)
    decay: float = Field(gt=0, lt=1)
    weights: LossWeights
    action_penalty: float = Field(gt=0)
    evaluate_every: PositiveInt
    seed: int = Field(ge=0)


class LatentParameters(Parameters):
    """Training and comparison of latent spaces over seeds."""

    seeds: PositiveInt
    stacks: PositiveInt
    starts: PositiveInt
    start_steps: PositiveInt
    map_unit_m: float = Field(gt=0)
    networks: LatentNetworkParameters
    training: LatentTrainingParameters
    pair_pool: PositiveInt
    evaluation_pairs: PositiveInt
    longest_chain: int = Field(ge=3)


class LatentSpaceParameters(Parameters):
    """Latent spaces of a small set of touches."""

    seeds: PositiveInt
    networks: LatentNetworkParameters
    training: LatentTrainingParameters
    pair_pool: int = Field(ge=1)
    evaluation_pairs: int = Field(ge=1)


class GeodesicParameters(Parameters):
    """Neighbour graph of the geodesic distances."""

    neighbours: int = Field(ge=2)
    bin_size: int = Field(ge=3)
    bins: int | None = Field(ge=1)
    bridge_mm: float = Field(ge=0)
    seed: int = Field(ge=0)
