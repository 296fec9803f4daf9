"""What is chosen for logs of your own arm."""

from pydantic import Field, NonNegativeInt

from structlearn.ground.params import Parameters


class MotionParameters(Parameters):
    """Identification of your own arm from logs of its joints. Fields: `stages/own/params.yaml`, `motion`."""

    source: str = Field(min_length=1)
    topic: str = Field(min_length=1)
    urdf: str = Field(min_length=1)
    locked_joints: tuple[str, ...]
    rate_hz: float = Field(gt=0, le=10_000)
    smoothing_hz: float = Field(gt=0)
    rest_rad_s: float = Field(gt=0)
    rest_s: float = Field(gt=0)
    test_logs: int = Field(ge=1)
    block_s: float = Field(gt=0)
    test_every: int = Field(ge=2)
    draws: int = Field(ge=100)
    seed: NonNegativeInt
    iterations: int = Field(ge=1)
    largest_condition: float = Field(gt=1)
    gravity_share: float = Field(gt=0, lt=1)
    gravity_n_m: float = Field(gt=0)

    @property
    def block(self) -> int:
        """Samples of a block."""
        return max(1, round(self.block_s * self.rate_hz))
