"""Numbers of the servoing testbed: what its stages wrote, and its metrics."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from structlearn.ground.artefacts import Metrics
from structlearn.ground.metrics import mean_interval
from structlearn.simulation.touch_demonstrator import ToucherParameters
from structlearn.tactile.electrodes import SKINS, Skin
from structlearn.tactile.flat_maps import map_laying
from structlearn.tactile.geodesics import GeodesicParameters
from structlearn.tactile.latent_comparison import LatentParameters
from structlearn.tactile.latent_evaluation import UNCHANGED
from structlearn.tactile.latent_models import FORWARD_OF, NO_INVERSE, TRAINED_WITH
from structlearn.tactile.touch_dataset import TEST, TEST_STRIDE, Chains, TouchDataset, chains
from structlearn.tactile.touch_preparation import TouchDataParameters
from structlearn.testbeds.servoing.page.servoing_loop import ServoLoop
from structlearn.testbeds.servoing.page.servoing_other_skins import OtherSkins
from structlearn.testbeds.servoing.page.servoing_published import TEST_CHAIN

TRAINED_DYNAMICS = tuple((forward, way) for forward, ways in TRAINED_WITH.items() for way in ways[1:])
"""Forward models with the inverse model whose loss they were trained with."""

SQUARE_MM = 1.5
"""Side of the squares of skin in which errors of contact points are gathered."""

ASKED = "encoder"
"""Comparison of directions that counts: the action is to lead to the latent state that followed."""


@dataclass(frozen=True)
class ServoingResults:
    """What the stages of the testbed wrote, and what follows from it.

    Attributes:
        dataset: samples of touch.
        truth: true contacts of simulated demonstrations, see `simulation.touch_demonstrator.true_contacts`;
            empty if they were recorded.
        latent: see `tactile.latent_evaluation.latent_errors`.
        forward: see `tactile.latent_evaluation.forward_errors`.
        directions: see `tactile.latent_evaluation.direction_errors`.
        curve: see `tactile.comparison.LatentComparison`.
        latent_map: see `tactile.latent_evaluation.latent_map`.
        loop: closed loops; only with the simulated finger that demonstrated.
        other_skins: all of it with fingers of another shape, always simulated.
        person: who demonstrates.
        preparation: how recordings became samples.
        geodesics: how distances were measured.
        learned: what was trained, and how.
    """

    dataset: TouchDataset
    truth: pd.DataFrame
    latent: pd.DataFrame
    forward: pd.DataFrame
    directions: pd.DataFrame
    curve: pd.DataFrame
    latent_map: pd.DataFrame
    loop: ServoLoop | None
    other_skins: OtherSkins
    person: ToucherParameters
    preparation: TouchDataParameters
    geodesics: GeodesicParameters
    learned: LatentParameters

    @property
    def simulated(self) -> bool:
        """Whether the demonstrations were simulated: only of these the true contacts are known."""
        return len(self.truth) > 0

    @property
    def skin(self) -> Skin:
        """That was touched with."""
        return SKINS[self.person.skin]

    @cached_property
    def pairs(self) -> int:
        """Number of pairs as the text counts them, over all splits and strides."""
        return len(chains(self.dataset, 2))

    @cached_property
    def tested(self) -> Chains:
        """The chains that forward and inverse models are tested on."""
        return chains(self.dataset, self.learned.longest_chain, (TEST_STRIDE,), TEST)

    @cached_property
    def contact_errors(self) -> pd.DataFrame:
        """Estimated against true contact points, of pressed samples.

        Returns:
            `error_mm`, the distance in space; `along_mm` and `across_mm`, its parts by surface coordinates,
            and where the true contact is, `true_along_mm` and `true_across_mm`; `pressure` in counts.
        """
        names = {name: number for number, name in enumerate(self.truth["trial"].unique())}
        true = self.truth.assign(
            trial=self.truth["trial"].map(names), sample=self._sample(self.truth["time_s"].to_numpy())
        ).set_index(["trial", "sample"])[["x_m", "y_m", "z_m"]]
        kept = np.flatnonzero(self.dataset.pressed)
        keys = pd.MultiIndex.from_arrays([self.dataset.trial[kept], self._sample(self.dataset.time[kept])])
        true = true.loc[keys].to_numpy(float)
        found = self.dataset.contact_point[kept].astype(float)
        places = [1e3 * np.stack(self.skin.coordinates(points)) for points in (found, true)]
        along, across = places[0] - places[1]
        return pd.DataFrame(
            {
                "error_mm": 1e3 * np.linalg.norm(found - true, axis=1),
                "along_mm": along,
                "across_mm": across,
                "true_along_mm": places[1][0],
                "true_across_mm": places[1][1],
                "pressure": self.dataset.pressure[kept],
            }
        )

    @cached_property
    def contact_bias(self) -> pd.DataFrame:
        """Mean errors over squares of skin.

        Returns:
            Middle of the true contacts' square, `square_along_mm`, `square_across_mm`; means of `along_mm`,
            `across_mm` and `error_mm` of `contact_errors`; `samples`; `squared_mm2`, their part in the sum of
            squared errors along and across that is the same for all of a square.
        """
        errors = self.contact_errors
        squares = [
            (SQUARE_MM * (np.floor(errors[f"true_{name}_mm"] / SQUARE_MM) + 0.5)).rename(f"square_{name}_mm")
            for name in ("along", "across")
        ]
        groups = errors[["along_mm", "across_mm", "error_mm"]].groupby(squares)
        means = groups.mean().assign(samples=groups.size())
        squared = means["samples"] * (means["along_mm"] ** 2 + means["across_mm"] ** 2)
        return means.assign(squared_mm2=squared).reset_index()

    def latents(self, column: str, structure: bool = True, split: str = "test") -> np.ndarray:
        """A column of `latent` over the seeds (S,)."""
        rows = self.latent[(self.latent["structure"] == structure) & (self.latent["split"] == split)]
        return rows.sort_values("seed")[column].to_numpy()

    def forwards(
        self, forward: str, trained_with: str, structure: bool, steps: int = TEST_CHAIN
    ) -> np.ndarray:
        """Forward NMSE over the seeds (S,)."""
        table = self.forward
        mask = (table["forward"] == forward) & (table["trained_with"] == trained_with)
        mask &= (table["structure"] == structure) & (table["steps"] == steps)
        return table[mask].sort_values("seed")["nmse"].to_numpy()

    def relative_forwards(
        self, forward: str, trained_with: str, structure: bool, steps: int = TEST_CHAIN
    ) -> np.ndarray:
        """Forward NMSE over that of the prediction that nothing moves, over the seeds (S,)."""
        still = self.forwards(UNCHANGED, NO_INVERSE, structure, steps)
        return self.forwards(forward, trained_with, structure, steps) / still

    @property
    def steps(self) -> list[int]:
        """Lengths of chains on which forward models were tested."""
        return sorted(self.forward["steps"].unique().tolist())

    def cosines(
        self,
        inverse: str,
        with_loss: bool = True,
        structure: bool = True,
        comparison: str = ASKED,
        part: str | None = None,
    ) -> np.ndarray:
        """Cosine distance of an inverse model over the seeds (S,), meant over both parts or of one.

        Args:
            inverse: its name.
            with_loss: whether its forward model was trained with its loss.
            structure: of the latent space.
            comparison: see `tactile.latent_evaluation.direction_errors`.
            part: of the action.
        """
        table = self.directions
        mask = (table["inverse"] == inverse) & (
            table["trained_with"] == (inverse if with_loss else NO_INVERSE)
        )
        mask &= (table["structure"] == structure) & (table["comparison"] == comparison)
        rows = table[mask if part is None else mask & (table["part"] == part)]
        return rows.groupby("seed")["distance"].mean().to_numpy()

    def steps_until(self, column: str, bound: float) -> int | None:
        """Steps of training from which on a column of `latent` stays below a bound in all seeds, if ever."""
        rows = self.curve[self.curve["structure"] & (self.curve["quantity"] == column)]
        worst = rows.groupby("step")["value"].max()
        above = worst.index[worst >= bound]
        low = worst.index[worst.index > above.max()] if len(above) else worst.index
        return int(low[0]) if len(low) else None

    @cached_property
    def map_on_skin(self) -> np.ndarray:
        """The latent map (N, 2) in mm, laid onto the surface coordinates."""
        flat = 1e3 * self.learned.map_unit_m * self.latent_map[["x", "y"]].to_numpy(float)
        return map_laying(flat, self.places)(flat)

    @cached_property
    def places(self) -> np.ndarray:
        """Surface coordinates (N, 2) of the estimated contact points in mm: along and across the finger."""
        return 1e3 * np.stack(self.skin.coordinates(self.dataset.contact_point.astype(float)), axis=1)

    def _sample(self, time: np.ndarray) -> np.ndarray:
        return np.rint(time * self.preparation.rate_hz).astype(int)


def seed_interval(values: np.ndarray) -> tuple[float, float]:
    """Mean over seeds and half the width of its 95 % interval."""
    return mean_interval(np.asarray(values))


def metrics(results: ServoingResults) -> Metrics:
    """The flat metrics of the testbed.

    All are means over seeds on the test split, of latent spaces with structure where nothing else is said.
    `forward_nmse_chain3_*` are of the non-linear model that was trained with NJ; cosine distances ask for the
    latent state that followed, each inverse model with the forward model trained with it, mean of the linear
    and the angular part. `contact_point_error_mm` is the median of pressed samples. For `servo_*` see
    `servoing_loop.ServoLoop.metrics` and `servoing_other_skins.OtherSkins.metrics`. What only a simulation
    tells is not there if the demonstrations were recorded.
    """
    values: Metrics = {
        "simulated": results.simulated,
        "samples": len(results.dataset),
        "pairs": results.pairs,
        "seeds": results.learned.seeds,
        "reconstruction_nmse_test": results.latents("reconstruction").mean(),
        "mds_nmse_test": results.latents("distances").mean(),
        "pressure_nmse_test": results.latents("pressure").mean(),
        "forward_nmse_chain3_struct": results.forwards("NL", "NJ", structure=True).mean(),
        "forward_nmse_chain3_nostruct": results.forwards("NL", "NJ", structure=False).mean(),
    }
    for inverse in FORWARD_OF:
        values[f"cosine_distance_{inverse.lower()}"] = results.cosines(inverse).mean()
    values["cosine_distance_nj_without_loss"] = results.cosines("NJ", with_loss=False).mean()
    if results.simulated:
        values["contact_point_error_mm"] = results.contact_errors["error_mm"].median()
    if results.loop is not None:
        values |= results.loop.metrics() | results.other_skins.metrics()
    return values
