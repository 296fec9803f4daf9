"""The simulated testbed in numbers, and what a single run on it meets.

The same robot, fingers and board serve all stages; what differs between runs of a real set-up is drawn from a
seed of each run, so any run can be repeated alone, bit for bit.
"""

import numpy as np
from pydantic import Field

from structlearn.ground.params import Parameters
from structlearn.simulation.fingers import TouchParameters
from structlearn.testbeds.scraping.world.corrector import CorrectorParameters
from structlearn.testbeds.scraping.world.execution import FINGER_TICKS, Conditions, ControlParameters
from structlearn.testbeds.scraping.world.layout import CONTACT_M
from structlearn.testbeds.scraping.world.recorder import RecorderParameters
from structlearn.testbeds.scraping.world.scraping_world import WorldParameters


class GuidanceParameters(Parameters):
    """The guiding person. Fields: `params.yaml`, `testbed.guidance`."""

    frequency_hz: float = Field(gt=0)
    force_n: float = Field(gt=0)
    force_spread: float = Field(ge=0)
    force_cv: float = Field(ge=0)
    force_fluctuation_s: float = Field(gt=0)
    force_i_m_n_s: float = Field(ge=0)


class VariationParameters(Parameters):
    """What differs between runs. Fields: `params.yaml`, `testbed.variation`."""

    board_roll_deg: float = Field(ge=0)
    friction: float = Field(ge=0)
    board_stiffness: float = Field(ge=0)


class TestbedParameters(Parameters):
    """The simulated testbed: the same robot, fingers and board for all stages."""

    __test__ = False  # not a test, whatever pytest thinks of its name

    seed: int = Field(ge=0)
    sensor_seed: int = Field(ge=0)
    world: WorldParameters
    control: ControlParameters
    touch: TouchParameters
    variation: VariationParameters
    recorder: RecorderParameters
    guidance: GuidanceParameters
    corrector: CorrectorParameters


def run_conditions(
    testbed: TestbedParameters,
    board_roll: float,
    rng: np.random.Generator,
    stiffness: float,
    force: np.ndarray,
    gains: tuple[float, float],
) -> Conditions:
    """What one run meets: the board's roll, friction and stiffness as they vary, drawn from `rng`.

    `board_roll`: rad, as set. `stiffness`: N/m per kg that holds the tool on its path. `force`: (T,) N that
    presses it on the board.
    """
    own = testbed.variation
    roll, friction, board = rng.standard_normal(3)
    return Conditions(
        board_roll=board_roll + np.radians(own.board_roll_deg) * roll,
        board_point=CONTACT_M,
        friction_factor=float(np.exp(own.friction * friction)),
        board_stiffness_factor=float(np.exp(own.board_stiffness * board)),
        stiffness=stiffness,
        force=force,
        force_gains=gains,
    )


def finger_rate(testbed: TestbedParameters) -> float:
    """Samples per second that the fingers give."""
    return testbed.world.control_rate_hz / FINGER_TICKS
