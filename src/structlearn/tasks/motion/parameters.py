"""Parameters of tasks on joint logs."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, NonNegativeInt, PositiveFloat, model_validator

from structlearn.core.params import Parameters
from structlearn.readers.joint_log import DriveLog, JointLog, read_log_table
from structlearn.readers.source import JointNames, SourceParameters

Log = Annotated[str, Field(min_length=1)]

AT_REST, IN_MOTION, DELAY = "gain at rest", "gain in motion", "delay"  # drive quantities in N m/A and s
FOUND, QUOTED = "found", "quoted"  # sets of gains for weighing a load
ALL_PAIRS = "all pairs"  # load from all pairs of logs together
CENTRE = [f"centre_{axis}_m" for axis in "xyz"]  # columns of a centre of mass

BLOCK_S = 2.0  # longer than errors are correlated: held out of a single log, and resampled for intervals
SEED = 0  # of the resampling of blocks
TEST_EVERY = 4  # of a single log, every fourth block is held out: enough of it to test and to learn from
LARGEST_CONDITION = 100.0  # of the base parameters; beyond it the motion excites too little (Gautier 1992)
GRAVITY_SHARE = 0.7  # least share of the URDF's gravity in a torque: masses of URDFs are off by less

# Stages while a load is followed, in order
LEARNED, EMPTY, CARRYING = "empty, learned from", "empty, another motion", "with the load"


class NetworkChoiceParameters(Parameters):
    """Networks trained for comparison; the best of several settings is chosen."""

    train_share: float = Field(gt=0, lt=1)
    hidden: tuple[tuple[int, ...], ...] = Field(min_length=1)
    rates: tuple[PositiveFloat, ...] = Field(min_length=1)
    epochs: tuple[int, ...] = Field(min_length=1)
    batch: int = Field(ge=1)
    second_moment_decay: float = Field(gt=0, lt=1)
    choice_seeds: int = Field(ge=1)
    seeds: int = Field(ge=1)


class DriveParameters(Parameters):
    """Drives of an arm that is observed through motor currents."""

    rest: Log | None
    assumed_gains: Mapping[int, int]
    quoted_gains: tuple[PositiveFloat, ...]
    delays_s: tuple[float, float]
    delay_step_s: float = Field(gt=0)


class LoadParameters(Parameters):
    """A load that some logs carry: weighed by pairs of logs, and estimated online."""

    pairs: tuple[tuple[Log, Log], ...]
    known_kg: float = Field(gt=0)
    structure: Literal["spd", "tri", "cov"]
    batch: int = Field(ge=1)
    memory_s: float = Field(gt=0)
    iterations: int = Field(ge=1)
    settled_s: float = Field(gt=0)


class MotionParameters(SourceParameters):
    """Joint logs of an arm, and its identification."""

    kind = "motion"

    topic: str = Field(min_length=1)
    urdf: str = Field(min_length=1)
    locked_joints: tuple[str, ...]
    joints: JointNames
    rate_hz: float = Field(gt=0, le=10_000)
    smoothing_hz: float = Field(gt=0)
    rest_rad_s: PositiveFloat | None
    rest_s: float = Field(gt=0)
    train: Log | None
    test: Log | None
    train_share: float | None = Field(gt=0, lt=1)
    draws: int = Field(ge=100)
    structures: tuple[Literal["nostr", "symm", "spd", "tri", "cov"], ...]
    iterations: int = Field(ge=1)
    joint_weights: Literal["variance", "limit"]
    prior: float = Field(ge=0)
    judged_friction: Literal["coulomb", "offset", "stiffness"]
    body_draws: NonNegativeInt
    gravity_n_m: float = Field(gt=0)
    traces_hz: float = Field(gt=0)
    networks: NetworkChoiceParameters | None
    drives: DriveParameters | None
    load: LoadParameters | None

    @model_validator(mode="after")
    def _parts_fit_together(self) -> Self:
        if (self.drives is not None or self.load is not None) and None in (self.train, self.test):
            raise ValueError("drives and load need logs that are named: train and test")
        if (self.train is None) != (self.test is None):
            raise ValueError("name both logs or none: train and test")
        if self.structures and "cov" not in self.structures:
            raise ValueError("structures lack cov, which becomes the URDF")
        return self

    def sources(self) -> dict[str, tuple[str, ...]]:
        """All files and folders that are read, as written in the entry, by their role."""
        return super().sources() | {"urdf": (self.urdf,)}

    @property
    def block(self) -> int:
        """Block length in samples."""
        return max(1, round(BLOCK_S * self.rate_hz))

    @property
    def drawing(self) -> tuple[int, int, int]:
        """Block length in samples, draws and seed of a bootstrap over blocks."""
        return self.block, self.draws, SEED


Entry = MotionParameters


def read_task_logs(path: Path, parameters: MotionParameters) -> dict[str, Any]:
    """Read an import's logs by name, with the signals that the parameters need."""
    kind: Any = DriveLog if parameters.drives else JointLog
    return {log.name: log for log in read_log_table(path, kind)}
