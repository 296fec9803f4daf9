"""What is chosen for latent spaces of recorded touch."""

from pydantic import Field

from structlearn.ground.params import Parameters
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentSpaceParameters


class LatentTouchParameters(Parameters):
    """Latent spaces of recorded touch."""

    faulty: tuple[str, ...]
    folds: int = Field(ge=2)
    simulated_repeats: int = Field(ge=1)
    geodesics: GeodesicParameters
    spaces: LatentSpaceParameters
