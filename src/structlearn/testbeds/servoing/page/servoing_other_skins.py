"""Fingers of another shape, by the same code: what they learned, and how they servo (II.1)."""

from dataclasses import dataclass
from functools import cached_property

import pandas as pd

from structlearn.ground.artefacts import Metrics
from structlearn.testbeds.servoing.page.servoing_loop import ACTING, ServoTrials
from structlearn.testbeds.servoing.protocol.other_skins import OtherSkinsParameters
from structlearn.testbeds.servoing.protocol.servo_trials import ServoTrialParameters

SKIN_NAMES = {"biotac": "BioTac", "flat_pad": "flat pad"}
"""Skins whose name in tables is not their name on the page."""


@dataclass(frozen=True)
class OtherSkins:
    """What the stage `other_skins` wrote, see `simulation.other_skins.with_other_skin`.

    Attributes:
        latent: errors of latent spaces.
        directions: cosine distances of inverse models.
        trials: closed loops.
        parameters: of the skins, and how much less is trained for them.
        servo: of the loops.
    """

    latent: pd.DataFrame
    directions: pd.DataFrame
    trials: pd.DataFrame
    parameters: OtherSkinsParameters
    servo: ServoTrialParameters

    @cached_property
    def loops(self) -> dict[str, ServoTrials]:
        """Closed loops by skin."""
        groups = self.trials.groupby("skin", sort=False)
        return {str(name): ServoTrials(rows, self.servo) for name, rows in groups}

    def table(self) -> pd.DataFrame:
        """Rows of `ServoTrials.table` with the column `skin`."""
        tables = [loop.table() for loop in self.loops.values()]
        return pd.concat(tables, keys=list(self.loops), names=["skin", None]).reset_index("skin")

    def metrics(self) -> Metrics:
        """Share of targets that the resting controller reaches with NJ, by skin."""
        return {f"servo_success_rate_{name}": loop.rate(ACTING)["rate"] for name, loop in self.loops.items()}


def skin_name(name: str) -> str:
    """How a skin is called on the page."""
    return SKIN_NAMES.get(name, name)
