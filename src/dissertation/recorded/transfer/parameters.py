"""Parameters of sets of touches, tried on each other and on simulated touch."""

from pydantic import Field

from structlearn.readers.source import SourceParameters
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentSpaceParameters


class TransferParameters(SourceParameters):
    """Latent spaces of sets of touches."""

    kind = __package__

    left_out: tuple[str, ...]
    simulated_repeats: int = Field(ge=1)
    geodesics: GeodesicParameters
    spaces: LatentSpaceParameters


Entry = TransferParameters
