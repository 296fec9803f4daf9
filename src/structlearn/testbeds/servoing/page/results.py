"""What the stages of the servoing testbed found, and its metrics."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.ground.artefacts import Metrics
from structlearn.ground.params import Parameters, read_values
from structlearn.reporting.studies import Study
from structlearn.tactile.electrodes import SKINS, Skin
from structlearn.tactile.flat_maps import map_laying
from structlearn.tactile.latent_variants import FORWARD_OF
from structlearn.tactile.touch_dataset import TEST, TEST_STRIDE, Chains, TouchDataset, chains
from structlearn.testbeds.servoing.files import OtherSkinTables
from structlearn.testbeds.servoing.names import OURS, TEXT
from structlearn.testbeds.servoing.protocol.contact_errors import contact_errors
from structlearn.testbeds.servoing.protocol.controller_scores import ControllerScores
from structlearn.testbeds.servoing.protocol.model_scores import ModelScores
from structlearn.testbeds.servoing.protocol.servo_variants import AS_DATA, Comparison

PUBLISHED = read_values(Path(__file__).with_name("published.yaml"))
"""Numbers as the dissertation prints them."""

STUDIES = ("people", "controller", "loss_weights")
"""What the page quotes of trials beside the pipeline, `benchmarks/studies/servoing`."""

AS_IT_STANDS = "as it stands"
"""Variant of a study in which nothing is changed."""

HEADLINES = (
    "reconstruction_nmse_test",
    "mds_nmse_test",
    "forward_nmse_chain3_struct",
    "cosine_distance_nj",
    "cosine_distance_nj_without_loss",
    "servo_trials",
    "servo_success_rate_published",
    "servo_success_rate",
    "servo_success_rate_nostruct",
    "servo_success_rate_sphere",
    "servo_success_rate_flat_pad",
)
"""Metrics that stand in `metrics.json`, as far as they are known."""


@dataclass(frozen=True)
class ServoingResults:
    """What the stages of the testbed wrote.

    Attributes:
        dataset: samples of touch.
        truth: true contacts of the demonstrations.
        models: what is known of the trained models.
        comparison: closed loops.
        skin_tables: all of it with fingers of another shape.
        chosen: parameters by their key in `params.yaml`.
        studies: what was tried beside the pipeline, by name; None where it was not.
    """

    dataset: TouchDataset
    truth: pd.DataFrame
    models: ModelScores
    comparison: Comparison
    skin_tables: OtherSkinTables
    chosen: Mapping[str, Parameters]
    studies: Mapping[str, Study | None]

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
        groups = self.skin_tables.trials.groupby("skin", sort=False)
        return {str(name): ControllerScores(rows) for name, rows in groups}

    @property
    def people(self) -> Study | None:
        """All that is reported here, of other people with other sensors."""
        return self.studies["people"]

    @cached_property
    def pairs(self) -> int:
        """Number of pairs as the text counts them, over all splits and strides."""
        return len(chains(self.dataset, 2))

    @cached_property
    def tested(self) -> Chains:
        """The chains that forward and inverse models are tested on."""
        return chains(self.dataset, self.chosen["train_latent"].longest_chain, (TEST_STRIDE,), TEST)

    @cached_property
    def contact_errors(self) -> pd.DataFrame:
        """See `protocol.contact_errors`."""
        return contact_errors(self.dataset, self.truth, self.skin)

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

    def metrics(self) -> Metrics:
        """The flat metrics of the testbed.

        All are means over seeds on the test split, of latent spaces with structure where nothing else is
        said. `forward_nmse_chain3_*` are of the non-linear model that was trained with NJ; cosine distances
        ask for the latent state that followed, each inverse model with the forward model trained with it.
        `contact_point_error_mm` is the median of pressed samples. `servo_*` are of the resting controller,
        with NJ where nothing else is said; `*_published` of the text's.
        """
        models = self.models
        values: Metrics = {
            "simulated": True,
            "samples": len(self.dataset),
            "pairs": self.pairs,
            "seeds": self.chosen["train_latent"].seeds,
            "reconstruction_nmse_test": models.latents("reconstruction").mean(),
            "mds_nmse_test": models.latents("distances").mean(),
            "pressure_nmse_test": models.latents("pressure").mean(),
            "forward_nmse_chain3_struct": models.forwards("NL", "NJ").mean(),
            "forward_nmse_chain3_nostruct": models.forwards("NL", "NJ", structure=False).mean(),
        }
        for column in ("plane", "third", "pressure", "electrodes"):
            for name, structure in (("struct", True), ("nostruct", False)):
                error = models.forwards("NL", "NJ", structure, column=column).mean()
                values[f"forward_nmse_chain3_{column}_{name}"] = error
        values |= {f"cosine_distance_{name.lower()}": models.cosines(name).mean() for name in FORWARD_OF}
        values["cosine_distance_nj_without_loss"] = models.cosines("NJ", with_loss=False).mean()
        values["contact_point_error_mm"] = self.contact_errors["error_mm"].median()
        return values | self._loop_metrics(self.trials)

    def _loop_metrics(self, loops: ControllerScores) -> Metrics:
        ours = loops.rate(OURS)
        rates = {f"{name}": (its, OURS) for name, its in self.skins.items()}
        rates |= {f"{name}_published": (its, TEXT) for name, its in self.skins.items()}
        for ending, nj in (("", OURS), ("_published", TEXT)):
            rates |= {f"{name.lower()}{ending}": (loops, replace(nj, inverse=name)) for name in ("LL", "NG")}
            rates[f"nostruct{ending}"] = loops, replace(nj, structure=False)
            rates[f"as_data{ending}"] = loops, replace(nj, change=AS_DATA)
        others = {f"servo_success_rate_{key}": its.rate(one)["rate"] for key, (its, one) in rates.items()}
        return {
            "servo_trials": int(ours["trials"]),
            "servo_success_rate_published": loops.rate(TEXT)["rate"],
            "servo_success_rate": ours["rate"],
            "servo_reach_s": ours["reach_s"] if np.isfinite(ours["reach_s"]) else None,
            "servo_path_ratio": ours["path_ratio"] if np.isfinite(ours["path_ratio"]) else None,
            "servo_contacts_lost": int(loops.counts(OURS)["lost"].sum()),
            "servo_contacts_lost_published": int(loops.counts(TEXT)["lost"].sum()),
        } | others
