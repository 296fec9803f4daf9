"""Outputs of the stages of the servoing testbed: what is selected from them, and errors of contact points."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core.params import read_values
from structlearn.reporting.studies import People, Study
from structlearn.tactile.electrodes import SKINS, Skin, map_laying
from structlearn.tactile.latent_parameters import NO_INVERSE
from structlearn.tactile.touch_dataset import TEST, TEST_STRIDE, Chains, TouchDataset, chains
from structlearn.testbeds.servoing.names import STILL
from structlearn.testbeds.servoing.protocol.servo_scores import ControllerScores
from structlearn.testbeds.servoing.protocol.servo_variants import Comparison

PUBLISHED = read_values(Path(__file__).with_name("published.yaml"))  # numbers as the dissertation prints them

STUDIES = ("people", "controller", "loss_weights")
"""What the page quotes of trials beside the pipeline, `benchmarks/studies/servoing`."""

PEOPLE_STUDY = "servoing/people"  # the study that verdicts stand on
AS_IT_STANDS = "as it stands"  # variant of a study in which nothing is changed
TEST_CHAIN = 3  # steps of prediction on which forward models are compared; they learn from two (II.4.4)
SQUARE_MM = 1.5  # side of the squares of skin in which errors are gathered


@dataclass(frozen=True)
class ModelScores:
    """Scores of the trained models; arrays are over S seeds. See `tactile.latent_comparison`."""

    latent: pd.DataFrame  # `latent_errors`
    forward: pd.DataFrame  # `forward_errors`
    decoded: pd.DataFrame  # `decoded_errors`
    directions: pd.DataFrame  # `direction_errors`
    curve: pd.DataFrame  # key figures while training, see `tactile.latent_comparison.LatentComparison`
    latent_map: pd.DataFrame  # `latent_map`

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
        mask = (table["inverse"] == inverse) & (table["structure"] == structure)
        mask &= table["trained_with"] == (inverse if with_loss else NO_INVERSE)
        mask &= table["comparison"] == comparison
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


@dataclass(frozen=True)
class ServoingResults:
    """Outputs of the stages of the testbed."""

    dataset: TouchDataset  # samples of touch
    truth: pd.DataFrame  # true contacts of the demonstrations
    models: ModelScores  # what is known of the trained models
    comparison: Comparison  # closed loops
    # of fingers of another shape, with a column `skin`: `latent` and `directions` as of `ModelScores`, and
    # `trials` as of `Comparison`
    skin_tables: Mapping[str, pd.DataFrame]
    chosen: Mapping[str, Any]  # parameters by their key in `params.yaml`
    studies: Mapping[str, Study | None]  # what was tried beside the pipeline, by name; None where it was not

    @property
    def skin(self) -> Skin:
        """That was touched with."""
        return SKINS[self.chosen["toucher"].skin]

    @cached_property
    def trials(self) -> ControllerScores:
        """Closed loops with this skin."""
        return ControllerScores(self.comparison.trials)

    @cached_property
    def skins(self) -> dict[str, ControllerScores]:
        """Closed loops with other skins, by skin."""
        groups = self.skin_tables["trials"].groupby("skin", sort=False)
        return {str(name): ControllerScores(rows) for name, rows in groups}

    @property
    def people(self) -> People:
        """All that is reported here, of several people, each with a sensor and models of their own."""
        return People(self.studies["people"], AS_IT_STANDS)

    def trials_per_person(self, skin: str = "") -> int:
        """Targets that each controller had over the models of one person, with this skin or another."""
        return self.chosen["other_skins" if skin else "train_latent"].seeds * self.chosen["servo"].trials

    @cached_property
    def pairs(self) -> int:
        """Number of pairs as the text counts them, over all splits and strides."""
        return len(chains(self.dataset, 2))

    @cached_property
    def tested(self) -> Chains:
        """The chains that forward and inverse models are tested on."""
        return chains(self.dataset, self.chosen["train_latent"].longest_chain, (TEST_STRIDE,), TEST)

    @cached_property
    def places(self) -> np.ndarray:
        """Surface coordinates (N, 2) of the estimated contact points in mm: along and across the finger."""
        return 1e3 * np.stack(self.skin.coordinates(self.dataset.contact_point.astype(float)), axis=1)

    @cached_property
    def map_on_skin(self) -> np.ndarray:
        """The latent map (N, 2) in mm, laid onto the surface coordinates."""
        unit_mm = 1e3 * self.chosen["train_latent"].map_unit_m
        flat = unit_mm * self.models.latent_map[["x", "y"]].to_numpy(float)
        return map_laying(flat, self.places)(flat)

    @cached_property
    def contact_errors(self) -> pd.DataFrame:
        """Estimated against true contact points, of pressed samples.

        Returns `error_mm`, the distance in space; `along_mm` and `across_mm`, its parts by surface
        coordinates, and where the true contact is, `true_along_mm` and `true_across_mm`.
        """
        dataset, truth = self.dataset, self.truth
        numbers = {name: number for number, name in enumerate(truth["trial"].unique())}
        rate_hz = float(dataset.rate_hz)
        samples = np.rint(truth["time_s"].to_numpy() * rate_hz).astype(int)
        true = truth.set_index([truth["trial"].map(numbers), samples])[["x_m", "y_m", "z_m"]]
        kept = np.flatnonzero(dataset.pressed)
        its = [dataset.trial[kept], np.rint(dataset.time[kept] * rate_hz).astype(int)]
        points = true.loc[pd.MultiIndex.from_arrays(its)].to_numpy(float)
        found = dataset.contact_point[kept].astype(float)
        estimated, real = (1e3 * np.stack(self.skin.coordinates(one)) for one in (found, points))
        along, across = estimated - real
        error_mm = 1e3 * np.linalg.norm(found - points, axis=1)
        columns = {"error_mm": error_mm, "along_mm": along, "across_mm": across}
        return pd.DataFrame(columns | {"true_along_mm": real[0], "true_across_mm": real[1]})


def contact_bias(errors: pd.DataFrame) -> pd.DataFrame:
    """Mean errors over squares of skin.

    `errors`: of `ServoingResults.contact_errors`. Returns middle of the true contacts' square,
    `square_along_mm`, `square_across_mm`; means of `along_mm`, `across_mm` and `error_mm`; `samples`;
    `squared_mm2`, their part in the sum of squared errors along and across that is the same for all of a
    square.
    """
    squares = [
        (SQUARE_MM * (np.floor(errors[f"true_{name}_mm"] / SQUARE_MM) + 0.5)).rename(f"square_{name}_mm")
        for name in ("along", "across")
    ]
    groups = errors[["along_mm", "across_mm", "error_mm"]].groupby(squares)
    means = groups.mean().assign(samples=groups.size())
    squared = means["samples"] * (means["along_mm"] ** 2 + means["across_mm"] ** 2)
    return means.assign(squared_mm2=squared).reset_index()
