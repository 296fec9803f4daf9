"""The person whose data, models and closed loops the page's figures and tables show as an example."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from dissertation.servoing import names
from dissertation.servoing.protocol.results import OWN, controller_keys, keyed, prediction_errors
from structlearn.tactile.electrodes import SKINS, Skin, align_map
from structlearn.tactile.touch_dataset import TEST, TEST_STRIDE, Chains, TouchDataset, chains

SQUARE_MM = 1.5  # side of the squares of skin over which errors are averaged


@dataclass(frozen=True)
class Shown:
    """What the testbed's stages wrote for one person, with the columns of the table of results."""

    dataset: TouchDataset
    truth: pd.DataFrame  # true contacts of the demonstrations
    models: Mapping[str, pd.DataFrame]  # tables of `tactile.latent_comparison.LatentComparison`
    loops: Mapping[str, pd.DataFrame]  # tables of `protocol.servo_trials.compare`, and `other_skins`
    other_skins: Mapping[str, pd.DataFrame]  # `latent` and `directions` of other skins, by `skin`
    chosen: Mapping[str, Any]  # parameters, keyed as in `params.yaml`

    @property
    def skin(self) -> Skin:
        """Skin of the demonstrations."""
        return SKINS[self.chosen["toucher"].skin]

    @cached_property
    def predictions(self) -> pd.DataFrame:
        """NMSE of chained predictions: rows by `space`, `model`, `loss`, `steps`; columns are seeds."""
        return prediction_errors(self.models).pivot_table(
            "latent", ["space", "model", "loss", "steps"], "seed"
        )

    @cached_property
    def relative(self) -> pd.DataFrame:
        """The same, divided by the NMSE of predicting no motion."""
        kind, errors = ["model", "loss"], self.predictions
        still = errors.xs(names.STILL, level=kind).reindex(errors.index.droplevel(kind))
        return errors / still.to_numpy()

    @cached_property
    def directions(self) -> pd.DataFrame:
        """Cosine distances: rows by `space`, `model`, `loss`, `target`; columns are seeds."""
        rows = ["space", "model", "loss", "target"]
        return keyed(self.models["directions"]).pivot_table("distance", rows, "seed")

    @cached_property
    def curves(self) -> pd.DataFrame:
        """Test errors during training, with structure: rows by `quantity`, `step`; columns are seeds."""
        curve = self.models["curve"]
        return curve[curve["structure"]].pivot_table("value", ["quantity", "step"], "seed")

    @cached_property
    def trials(self) -> pd.DataFrame:
        """Closed-loop trials on all skins."""
        trials = pd.concat([self.loops["trials"].assign(skin=OWN), self.loops["other_skins"]])
        return keyed(trials)

    @cached_property
    def reached(self) -> pd.DataFrame:
        """Targets with the first skin, `sum` reached of `size`: rows by a controller's keys, and `seed`."""
        groups = keyed(self.loops["trials"]).groupby([*controller_keys(names.OURS), "seed"])
        return groups["success"].agg(["sum", "size"])

    @cached_property
    def pairs(self) -> int:
        """Number of pairs as the dissertation counts them, over all splits and strides."""
        return len(chains(self.dataset, 2))

    @cached_property
    def tested(self) -> Chains:
        """Test chains of the forward and inverse models."""
        return chains(self.dataset, self.chosen["train_latent"].longest_chain, (TEST_STRIDE,), TEST)

    @cached_property
    def places(self) -> np.ndarray:
        """Surface coordinates (N, 2) of the estimated contact points in mm: along and across the finger."""
        return 1e3 * np.stack(self.skin.coordinates(self.dataset.contact_point.astype(float)), axis=1)

    @cached_property
    def map_on_skin(self) -> np.ndarray:
        """Latent map (N, 2) in mm, aligned with the surface coordinates."""
        unit_mm = 1e3 * self.chosen["train_latent"].map_unit_m
        flat = unit_mm * self.models["latent_map"][["x", "y"]].to_numpy(float)
        return align_map(flat, self.places)(flat)

    @cached_property
    def contact_errors(self) -> pd.DataFrame:
        """Errors of the estimated contact points of pressed samples.

        Columns: `error_mm`, Euclidean distance; `along_mm` and `across_mm`, differences in surface
        coordinates; `true_along_mm` and `true_across_mm`, the true contact.
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

    @cached_property
    def contact_bias(self) -> pd.DataFrame:
        """Mean of `contact_errors` over squares of skin, by true contact.

        Columns: `square_along_mm`, `square_across_mm`, the square's centre; means of `along_mm`,
        `across_mm`, `error_mm`; `samples`.
        """
        errors = self.contact_errors
        squares = [
            (SQUARE_MM * (np.floor(errors[f"true_{name}_mm"] / SQUARE_MM) + 0.5)).rename(f"square_{name}_mm")
            for name in ("along", "across")
        ]
        groups = errors[["along_mm", "across_mm", "error_mm"]].groupby(squares)
        return groups.mean().assign(samples=groups.size()).reset_index()

    @property
    def fixed_share(self) -> float:
        """Share of the squared errors of contact points that depends on the square of skin alone."""
        errors, bias = (one[["along_mm", "across_mm"]] for one in (self.contact_errors, self.contact_bias))
        squared = self.contact_bias["samples"] * (bias**2).sum(axis=1)
        return float(squared.sum() / (errors**2).to_numpy().sum())
