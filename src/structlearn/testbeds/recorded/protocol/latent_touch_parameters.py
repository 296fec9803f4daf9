"""What is chosen for latent spaces of recorded touch."""

from pydantic import Field

from structlearn.ground.params import Parameters
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentSpaceParameters


class LatentTouchParameters(Parameters):
    """Parameters of the latent spaces of recorded touch.

    Attributes:
        faulty: trials in which an electrode jumped; left out altogether.
        folds: parts of a set, by trial, that are left out in turn.
        simulated_repeats: simulated demonstrations per area of the skin and part; fewer than in the main
            pipeline, so that the sets are of like size.
        geodesics: the neighbour graph of each set.
        spaces: how the autoencoders are trained.
    """

    faulty: tuple[str, ...]
    folds: int = Field(ge=2)
    simulated_repeats: int = Field(ge=1)
    geodesics: GeodesicParameters
    spaces: LatentSpaceParameters
