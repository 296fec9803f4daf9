"""Which controllers are compared in closed loop, what is chosen for them, and what is kept of it."""

from dataclasses import dataclass

import pandas as pd
from pydantic import Field, PositiveInt

from structlearn.ground.params import Parameters
from structlearn.tactile.latent_variants import FORWARD_OF, STRUCTURES
from structlearn.testbeds.servoing.protocol.servo_scores import ToleranceParameters
from structlearn.testbeds.servoing.world.servo_loop import LoopParameters

PUBLISHED, RESTING = "published", "resting"
"""Forms of the controllers."""

QUICK_FILTER = "quick filter"
SLOW_FILTER, SLOW_ACTIONS, WHOLE_WAY = "slow filter", "slow actions", "whole way"
ALL_ALIKE, DERIVATIVE = "all actions alike", "derivative at rest"
CHANGES = (SLOW_FILTER, SLOW_ACTIONS, WHOLE_WAY, ALL_ALIKE, DERIVATIVE)
"""What is taken from the resting controller, one at a time."""


class PublishedParameters(Parameters):
    """Controllers as published; the action limit and the gain are in the networks' units.

    Attributes:
        loop: timing.
        action_penalty: beta (eq. II.12).
        gradient_gain: alpha of NG (eq. II.14).
        largest_action: bound of |a|, in root mean squares of the demonstrated actions.
    """

    loop: LoopParameters
    action_penalty: float = Field(gt=0)
    gradient_gain: float = Field(gt=0)
    largest_action: float = Field(gt=0)


class RestingParameters(Parameters):
    """Controllers that act more cautiously (`tactile.resting_servo`).

    Attributes:
        loop: timing.
        action_penalty: beta, for actions in units of likely ones.
        largest_action: bound of |a|, in root mean squares of the demonstrated actions.
        approach: part of the way to the target that a step is to go.
        spread: half the distance over which slopes are taken, in likely actions.
    """

    loop: LoopParameters
    action_penalty: float = Field(gt=0)
    largest_action: float = Field(gt=0)
    approach: float = Field(gt=0, le=1)
    spread: float = Field(gt=0)


class ServoTrialParameters(Parameters):
    """Closed loops.

    Attributes:
        seed: of contacts and noise.
        trials: of each controller per seed of the models; a third each rotation, translation, mixed.
        duration_s: of a trial.
        load_n: range of the loads at start and target.
        tilt_deg: std of pitch and yaw by which a finger is held askew.
        rest_s: before a target is read, and before a trial starts.
        follow_s: time constant with which the robot takes up a velocity.
        horizon: steps of the controllers that look further ahead than one.
        published: controllers as published.
        resting: more cautious ones.
        tolerance: when a target counts as reached.
        shown: trials per seed whose paths are kept.
    """

    seed: int = Field(ge=0)
    trials: PositiveInt
    duration_s: float = Field(gt=0)
    load_n: tuple[float, float]
    tilt_deg: float = Field(ge=0)
    rest_s: float = Field(gt=0)
    follow_s: float = Field(gt=0)
    horizon: int = Field(ge=2)
    published: PublishedParameters
    resting: RestingParameters
    tolerance: ToleranceParameters
    shown: PositiveInt


@dataclass(frozen=True)
class Variant:
    """A controller that is compared.

    Attributes:
        form: `PUBLISHED` or `RESTING`.
        inverse: LL, NG or NJ.
        structure: whether its latent space has structure.
        with_loss: whether its forward model was trained with the loss of the inverse model.
        horizon: steps ahead.
        change: what is different; empty for most.
    """

    form: str
    inverse: str
    structure: bool = True
    with_loss: bool = True
    horizon: int = 1
    change: str = ""


@dataclass(frozen=True)
class Comparison:
    """What is kept of all closed loops; the columns of `Variant` tell the controllers.

    Attributes:
        trials: `seed`, `trial`, `motion`, contacts and latent states of start and target, and the columns of
            `servo_scores.scored`.
        progress: see `servo_scores.progress`.
        paths: of the first trials of every seed and some controllers, see `servo_trials._paths`.
    """

    trials: pd.DataFrame
    progress: pd.DataFrame
    paths: pd.DataFrame


def variants(horizon: int) -> list[Variant]:
    """All controllers that are compared."""
    every = [
        Variant(form, inverse, structure, with_loss)
        for form in (PUBLISHED, RESTING)
        for structure in STRUCTURES
        for with_loss in (True, False)
        for inverse in FORWARD_OF
    ]
    further = [
        Variant(form, inverse, horizon=horizon) for form in (PUBLISHED, RESTING) for inverse in ("LL", "NJ")
    ]
    quick = [Variant(PUBLISHED, inverse, change=QUICK_FILTER) for inverse in FORWARD_OF]
    without = [Variant(RESTING, "NJ", change=change) for change in CHANGES]
    return every + further + quick + without
