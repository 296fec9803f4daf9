"""What is chosen for logs of your own arm."""

from pydantic import Field, NonNegativeInt

from structlearn.ground.params import Parameters


class MotionParameters(Parameters):
    """Identification of your own arm from logs of its joints.

    Attributes:
        source: file or folder of logs: `sensor_msgs/JointState` with positions, velocities and efforts.
        topic: of the joint states.
        urdf: file of the arm; `~` is the home folder.
        locked_joints: that are not identified, e.g. those of a gripper; they are held at position zero.
        rate_hz: of the clock that logs are put on.
        smoothing_hz: zero-phase low-pass of all signals.
        rest_rad_s: the arm rests where no joint is faster (m/s where joints slide).
        rest_s: rests of this length end a motion; only the longest motion of a log is taken.
        test_logs: so many of the last logs are asked about and not learned from, but never all.
        block_s: time blocks, longer than errors remember: of a lone log some are held out, and intervals come
            from drawing blocks anew.
        test_every: of a lone log every so manieth block is held out.
        draws: of blocks.
        seed: of the draws.
        iterations: of L-BFGS for bodies that can exist.
        largest_condition: of the base parameters' regressor, columns scaled alike; beyond it the motion
            excites too little.
        gravity_share: of the URDF's gravity that a joint's torque shows at least, and one over it at most.
        gravity_n_m: joints on which gravity varies by less (std) do not tell.
    """

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
