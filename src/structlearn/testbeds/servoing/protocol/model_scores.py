"""How good latent spaces and their models are: selections and means over seeds of what was evaluated."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from structlearn.ground.metrics import mean_interval
from structlearn.tactile.latent_parameters import FORWARD_OF, NO_INVERSE, STRUCTURES
from structlearn.tactile.touch_dataset import SPLITS
from structlearn.testbeds.servoing.names import (
    COMPARISON_NAMES,
    DYNAMICS,
    LATENT_NAMES,
    PART_NAMES,
    STILL,
    STRUCTURE_NAMES,
    dynamics_name,
)

TEST_CHAIN = 3
"""Steps of prediction on which forward models are compared; they learn from two (II.4.4)."""


PARTS = ("plane", "third", "electrodes", "pressure")
"""What else is known of a prediction: parts of the latent state, and the touch that it is decoded to."""


@dataclass(frozen=True)
class ModelScores:
    """What is known of the trained models; arrays are over S seeds."""

    latent: pd.DataFrame  # see `tactile.latent_evaluation.latent_errors`
    forward: pd.DataFrame  # see `tactile.latent_evaluation.forward_errors`
    decoded: pd.DataFrame  # see `tactile.latent_evaluation.decoded_errors`
    directions: pd.DataFrame  # see `tactile.latent_evaluation.direction_errors`
    curve: pd.DataFrame  # key figures while training, see `tactile.latent_comparison.LatentComparison`
    latent_map: pd.DataFrame  # see `tactile.latent_evaluation.latent_map`

    @property
    def steps(self) -> list[int]:
        """Lengths of chains on which forward models were tested."""
        return sorted(self.forward["steps"].unique().tolist())

    def latents(self, column: str, structure: bool = True, split: str = "test") -> np.ndarray:
        """An error of latent spaces (S,)."""
        rows = self.latent[(self.latent["structure"] == structure) & (self.latent["split"] == split)]
        return rows.sort_values("seed")[column].to_numpy()

    def forwards(
        self,
        forward: str,
        trained_with: str,
        structure: bool = True,
        steps: int = TEST_CHAIN,
        column: str = "nmse",
    ) -> np.ndarray:
        """Forward NMSE (S,), or another column of `forward` or `decoded`."""
        table = self.forward if column in self.forward else self.decoded
        mask = (table["forward"] == forward) & (table["trained_with"] == trained_with)
        mask &= (table["structure"] == structure) & (table["steps"] == steps)
        return table[mask].sort_values("seed")[column].to_numpy()

    def relative_forwards(
        self, forward: str, trained_with: str, structure: bool = True, steps: int = TEST_CHAIN
    ) -> np.ndarray:
        """Forward NMSE over that of the prediction that nothing moves (S,)."""
        still = self.forwards(*STILL, structure, steps)
        return self.forwards(forward, trained_with, structure, steps) / still

    def cosines(
        self,
        inverse: str,
        with_loss: bool = True,
        structure: bool = True,
        comparison: str = "encoder",
        part: str | None = None,
    ) -> np.ndarray:
        """Cosine distance (S,) of an inverse model, averaged over both parts of an action or of one.

        `with_loss`: whether its forward model was trained with its loss; `comparison`: as a rule, the action
        is to lead to the latent state that followed.
        """
        table = self.directions
        trained_with = inverse if with_loss else NO_INVERSE
        mask = (table["inverse"] == inverse) & (table["trained_with"] == trained_with)
        mask &= (table["structure"] == structure) & (table["comparison"] == comparison)
        rows = table[mask if part is None else mask & (table["part"] == part)]
        return rows.groupby("seed")["distance"].mean().to_numpy()

    def training(self, quantity: str) -> pd.DataFrame:
        """A key figure while training, with structure: rows are steps, columns seeds."""
        rows = self.curve[self.curve["structure"] & (self.curve["quantity"] == quantity)]
        return rows.pivot_table("value", "step", "seed")

    def steps_until(self, quantity: str, bound: float) -> int | None:
        """Steps of training from which on a key figure stays below a bound in all seeds, if ever."""
        above = (self.training(quantity).max(axis=1) >= bound)[::-1].cummax()
        return None if above.iloc[0] else int(above.index[~above][-1])

    def halfway(self, quantity: str) -> float:
        """Mean over seeds of a key figure at half of the steps, or the first point after it."""
        means = self.training(quantity).mean(axis=1)
        return float(means[means.index >= 0.5 * means.index.max()].iloc[0])

    def latent_table(self) -> pd.DataFrame:
        """Errors of latent spaces: `space`, `split`; mean, half interval and worst seed of each column."""
        rows = []
        for structure in STRUCTURES:
            for split in SPLITS:
                row: dict[str, object] = {"space": STRUCTURE_NAMES[structure], "split": split}
                for column in LATENT_NAMES:
                    values = self.latents(column, structure, split)
                    mean, half = mean_interval(values)
                    row |= {column: mean, f"{column}_half": half, f"{column}_worst": values.max()}
                rows.append(row)
        return pd.DataFrame(rows)

    def forward_table(self) -> pd.DataFrame:
        """Forward NMSE per length of the chain (figure II.4).

        Returns `model`, `space`, `steps`, `nmse` (mean over seeds), `half` (of its 95 % interval), `relative`
        and `relative_half`: over the error of the prediction that nothing moves; and means of `PARTS`.
        """
        rows = []
        for kind in (STILL, *DYNAMICS):
            for structure in STRUCTURES:
                for steps in self.steps:
                    case = (*kind, structure, steps)
                    names = (dynamics_name(*kind), STRUCTURE_NAMES[structure], steps)
                    nmse, relative = self.forwards(*case), self.relative_forwards(*case)
                    parts = [self.forwards(*case, part).mean() for part in PARTS]
                    rows.append((*names, *mean_interval(nmse), *mean_interval(relative), *parts))
        columns = ["model", "space", "steps", "nmse", "half", "relative", "relative_half", *PARTS]
        return pd.DataFrame(rows, columns=columns)

    def direction_table(self) -> pd.DataFrame:
        """Cosine distances (figure II.5).

        Returns `inverse`, `loss` (whether trained with it), `space`, and per comparison the mean over seeds
        of both parts, `<comparison>`, half its interval, `<comparison>_half`, and of each part alone,
        `<comparison>_linear`, `<comparison>_angular`.
        """
        rows = []
        ways = [(loss, structure) for loss in (True, False) for structure in STRUCTURES]
        for name, way in ((name, way) for name in FORWARD_OF for way in ways):
            row: dict[str, object] = {"inverse": name, "loss": way[0], "space": STRUCTURE_NAMES[way[1]]}
            for comparison in COMPARISON_NAMES:
                mean, half = mean_interval(self.cosines(name, *way, comparison))
                row |= {comparison: mean, f"{comparison}_half": half}
                for part, word in PART_NAMES.items():
                    row[f"{comparison}_{word}"] = self.cosines(name, *way, comparison, part).mean()
            rows.append(row)
        return pd.DataFrame(rows)


def skin_table(latent: pd.DataFrame, directions: pd.DataFrame) -> pd.DataFrame:
    """What was learned of other skins, with structure, on test contacts; means over seeds.

    `latent`: as of `ModelScores`, with a column `skin`. Returns `skin`; the errors of `LATENT_NAMES`; cosine
    distances of actions to reach what followed, by inverse models that were trained with their loss:
    `<inverse>_linear`, `<inverse>_angular`.
    """
    spaces = latent[latent["structure"] & (latent["split"] == "test")]
    own = directions["structure"] & (directions["inverse"] == directions["trained_with"])
    asked = directions[own & (directions["comparison"] == "encoder")]
    asked = asked.assign(key=asked["inverse"] + "_" + asked["part"].map(PART_NAMES))
    distances = asked.pivot_table("distance", "skin", "key")
    columns = [f"{inverse}_{part}" for inverse in FORWARD_OF for part in PART_NAMES.values()]
    errors = spaces.groupby("skin", sort=False)[list(LATENT_NAMES)].mean()
    return errors.join(distances[columns]).reset_index()
