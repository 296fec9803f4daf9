"""How good latent spaces, their models and estimated contact points are: selections and means over seeds."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from structlearn.core.metrics import mean_interval
from structlearn.tactile.electrodes import Skin
from structlearn.tactile.latent_parameters import FORWARD_OF, NO_INVERSE, STRUCTURES
from structlearn.tactile.touch_dataset import SPLITS, TouchDataset
from structlearn.testbeds.servoing.names import (
    COMPARISON_NAMES,
    DYNAMICS,
    LATENT_NAMES,
    PART_NAMES,
    STILL,
    STRUCTURE_NAMES,
    dynamics_name,
)

TEST_CHAIN = 3  # steps of prediction on which forward models are compared; they learn from two (II.4.4)


PARTS = ("plane", "third", "electrodes", "pressure")
"""What else is known of a prediction: parts of the latent state, and the touch that it is decoded to."""

SQUARE_MM = 1.5  # side of the squares of skin in which errors are gathered


@dataclass(frozen=True)
class ModelScores:
    """Scores of the trained models; arrays are over S seeds."""

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


def contact_errors(dataset: TouchDataset, truth: pd.DataFrame, skin: Skin) -> pd.DataFrame:
    """Estimated against true contact points, of pressed samples.

    `dataset`: samples of touch, which number demonstrations in the order of `truth`; `truth`: see
    `simulation.touch_demonstrator.true_contacts`. Returns `error_mm`, the distance in space; `along_mm` and
    `across_mm`, its parts by surface coordinates, and where the true contact is, `true_along_mm` and
    `true_across_mm`.
    """
    names = {name: number for number, name in enumerate(truth["trial"].unique())}
    true = truth.assign(
        trial=truth["trial"].map(names), sample=_sample(truth["time_s"].to_numpy(), dataset)
    ).set_index(["trial", "sample"])[["x_m", "y_m", "z_m"]]
    kept = np.flatnonzero(dataset.pressed)
    keys = pd.MultiIndex.from_arrays([dataset.trial[kept], _sample(dataset.time[kept], dataset)])
    true = true.loc[keys].to_numpy(float)
    found = dataset.contact_point[kept].astype(float)
    places = [1e3 * np.stack(skin.coordinates(points)) for points in (found, true)]
    along, across = places[0] - places[1]
    return pd.DataFrame(
        {
            "error_mm": 1e3 * np.linalg.norm(found - true, axis=1),
            "along_mm": along,
            "across_mm": across,
            "true_along_mm": places[1][0],
            "true_across_mm": places[1][1],
        }
    )


def contact_bias(errors: pd.DataFrame) -> pd.DataFrame:
    """Mean errors over squares of skin.

    `errors`: of `contact_errors`. Returns middle of the true contacts' square, `square_along_mm`,
    `square_across_mm`; means of `along_mm`, `across_mm` and `error_mm`; `samples`; `squared_mm2`, their part
    in the sum of squared errors along and across that is the same for all of a square.
    """
    squares = [
        (SQUARE_MM * (np.floor(errors[f"true_{name}_mm"] / SQUARE_MM) + 0.5)).rename(f"square_{name}_mm")
        for name in ("along", "across")
    ]
    groups = errors[["along_mm", "across_mm", "error_mm"]].groupby(squares)
    means = groups.mean().assign(samples=groups.size())
    squared = means["samples"] * (means["along_mm"] ** 2 + means["across_mm"] ** 2)
    return means.assign(squared_mm2=squared).reset_index()


def _sample(time: np.ndarray, dataset: TouchDataset) -> np.ndarray:
    return np.rint(time * float(dataset.rate_hz)).astype(int)
