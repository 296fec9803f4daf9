"""What is chosen for dynamics models of the recorded arm."""

from pydantic import Field

from structlearn.ground.params import Parameters


class RecordedDynamicsParameters(Parameters):
    """Parameters of identification from the recorded motion."""

    urdf: str
    locked_joints: tuple[str, ...]
    rate_hz: float = Field(gt=0)
    cutoff_hz: float = Field(gt=0)
    train_share: float = Field(gt=0, lt=1)
    iterations: int = Field(ge=1)
    seeds: int = Field(ge=1)
    epochs: int = Field(ge=1)
