"""What is chosen for dynamics models of the recorded arm."""

from pydantic import Field

from structlearn.ground.params import Parameters


class RecordedDynamicsParameters(Parameters):
    """Parameters of identification from the recorded motion.

    Attributes:
        urdf: of the recorded arm (`simulation.arm.ArmParameters`).
        locked_joints: of its gripper.
        rate_hz: of the clock.
        cutoff_hz: of the low-pass on all signals.
        train_share: the first part of the motion, which is learned from.
        iterations: of L-BFGS for a structure.
        seeds: networks of each kind.
        epochs: of the networks; there is no threshold, all are run.
    """

    urdf: str
    locked_joints: tuple[str, ...]
    rate_hz: float = Field(gt=0)
    cutoff_hz: float = Field(gt=0)
    train_share: float = Field(gt=0, lt=1)
    iterations: int = Field(ge=1)
    seeds: int = Field(ge=1)
    epochs: int = Field(ge=1)
