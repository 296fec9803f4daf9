"""Outputs of the stages of the servoing testbed, and its metrics."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core.artefacts import Metrics
from structlearn.core.params import read_values
from structlearn.reporting.studies import Study
from structlearn.tactile.electrodes import SKINS, Skin, map_laying
from structlearn.tactile.latent_parameters import FORWARD_OF, JACOBIAN, LOCALLY_LINEAR, NO_INVERSE, STRUCTURES
from structlearn.tactile.touch_dataset import SPLITS, TEST, TEST_STRIDE, Chains, TouchDataset, chains
from structlearn.testbeds.servoing.files import OtherSkinTables
from structlearn.testbeds.servoing.names import DYNAMICS, OURS, TEXT
from structlearn.testbeds.servoing.protocol.model_scores import TEST_CHAIN, ModelScores, contact_errors
from structlearn.testbeds.servoing.protocol.servo_scores import ControllerScores
from structlearn.testbeds.servoing.protocol.servo_variants import (
    AS_DATA,
    Comparison,
    Variant,
    variants_of_other_skins,
)

PUBLISHED = read_values(Path(__file__).with_name("published.yaml"))  # numbers as the dissertation prints them

STUDIES = ("people", "controller", "loss_weights")
"""What the page quotes of trials beside the pipeline, `benchmarks/studies/servoing`."""

PEOPLE_STUDY = "servoing/people"  # the study that verdicts stand on
AS_IT_STANDS = "as it stands"  # variant of a study in which nothing is changed
SPACE_KEYS = {True: "struct", False: "nostruct"}  # latent spaces in the names of metrics

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
    """Outputs of the stages of the testbed."""

    dataset: TouchDataset  # samples of touch
    truth: pd.DataFrame  # true contacts of the demonstrations
    models: ModelScores  # what is known of the trained models
    comparison: Comparison  # closed loops
    skin_tables: OtherSkinTables  # all of it with fingers of another shape
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
        groups = self.skin_tables.trials.groupby("skin", sort=False)
        return {str(name): ControllerScores(rows) for name, rows in groups}

    @property
    def people(self) -> Study | None:
        """All that is reported here, of several people, each with a sensor and models of their own."""
        return self.studies["people"]

    def of_people(self, key: str) -> np.ndarray | None:
        """A metric by person (P,); None where the study was not run, or kept no such number."""
        people = self.people
        return people.values(AS_IT_STANDS, key) if people is not None and key in people.table else None

    def trials_per_person(self, skin: str = "") -> int:
        """Targets that each controller had over the models of one person, with this skin or another."""
        seeds = self.chosen["other_skins" if skin else "train_latent"].seeds
        return seeds * self.chosen["servo"].trials

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
        said. `forward_nmse_chain3_*` are of the non-linear model that was trained with NJ where no model is
        named (`forward_key`); cosine distances ask for the latent state that followed, `*_predicted` for the
        predicted one, each inverse model with the forward model trained with it. `contact_point_error_mm` is
        the median of pressed samples. `servo_*` are of the resting controller, with NJ where nothing else is
        said; `*_published` of the text's (`rate_key`). `people_*` are means over the people of the study.
        """
        models = self.models
        values: Metrics = {
            "simulated": True,
            "samples": len(self.dataset),
            "pairs": self.pairs,
            "seeds": self.chosen["train_latent"].seeds,
            "pressure_nmse_test": models.latents("pressure").mean(),
            "forward_nmse_chain3_struct": models.forwards("NL", "NJ").mean(),
            "forward_nmse_chain3_nostruct": models.forwards("NL", "NJ", structure=False).mean(),
        }
        for split in SPLITS:
            values[f"reconstruction_nmse_{split}"] = models.latents("reconstruction", split=split).mean()
            values[f"mds_nmse_{split}"] = models.latents("distances", split=split).mean()
        for column in ("plane", "third", "pressure", "electrodes"):
            for structure in STRUCTURES:
                error = models.forwards("NL", "NJ", structure, column=column).mean()
                values[f"forward_nmse_chain3_{column}_{SPACE_KEYS[structure]}"] = error
        for kind, structure in product(DYNAMICS, STRUCTURES):
            for steps in range(1, TEST_CHAIN + 1):
                error = models.forwards(*kind, structure, steps).mean()
                values[forward_key(*kind, structure, steps)] = error
            error = models.forwards(*kind, structure, column="pressure").mean()
            values[forward_key(*kind, structure, column="pressure")] = error
        for name in FORWARD_OF:
            values[f"cosine_distance_{name.lower()}"] = models.cosines(name).mean()
            predicted = models.cosines(name, comparison="forward").mean()
            values[f"cosine_distance_{name.lower()}_predicted"] = predicted
        values["cosine_distance_nj_without_loss"] = models.cosines("NJ", with_loss=False).mean()
        values["contact_point_error_mm"] = self.contact_errors["error_mm"].median()
        return values | self._loop_metrics(self.trials) | self._people_metrics()

    def _loop_metrics(self, loops: ControllerScores) -> Metrics:
        ours = loops.rate(OURS)
        rates = {rate_key(one): loops.rate(one)["rate"] for one in rated()}
        for skin, its in self.skins.items():
            rates |= {rate_key(one, skin): its.rate(one)["rate"] for one in variants_of_other_skins()}
        return {
            "servo_trials": int(ours["trials"]),
            "servo_reach_s": ours["reach_s"] if np.isfinite(ours["reach_s"]) else None,
            "servo_path_ratio": ours["path_ratio"] if np.isfinite(ours["path_ratio"]) else None,
            "servo_contacts_lost": int(loops.counts(OURS)["lost"].sum()),
            "servo_contacts_lost_published": int(loops.counts(TEXT)["lost"].sum()),
        } | rates

    def _people_metrics(self) -> Metrics:
        """Means over people of what the front page shows; nothing where they were not studied."""
        keys = ["mds_nmse_test", "cosine_distance_nj"]
        keys += [rate_key(one) for one in (TEXT, replace(TEXT, inverse=LOCALLY_LINEAR), OURS)]
        numbers = {key: its for key in keys if (its := self.of_people(key)) is not None}
        if len(numbers) < len(keys):
            return {}
        return {"people": len(numbers[keys[0]])} | {
            f"people_{key}": one.mean() for key, one in numbers.items()
        }


def rated() -> list[Variant]:
    """Controllers whose share of targets is a metric."""
    every = product((TEXT, OURS), FORWARD_OF, STRUCTURES, (True, False))
    found = [
        replace(form, inverse=name, structure=structure, with_loss=loss)
        for form, name, structure, loss in every
    ]
    return found + [replace(form, change=AS_DATA) for form in (TEXT, OURS)]


def rate_key(variant: Variant, skin: str = "") -> str:
    """`servo_success_rate_ll_nostruct_published`: the metric of a controller's share of targets.

    NJ, structure, the loss of the inverse model and the resting form go without saying.
    """
    words = (
        skin,
        "" if variant.inverse == JACOBIAN else variant.inverse.lower(),
        "" if variant.structure else SPACE_KEYS[False],
        "" if variant.with_loss else "without_loss",
        "as_data" if variant.change == AS_DATA else "",
        "published" if variant.form == TEXT.form else "",
    )
    return "_".join(["servo_success_rate", *filter(None, words)])


def forward_key(
    forward: str, trained_with: str, structure: bool, steps: int = TEST_CHAIN, column: str = ""
) -> str:
    """`forward_nmse_chain3_pressure_nl_nj_struct`: the metric of a forward model's error."""
    way = "" if trained_with == NO_INVERSE else trained_with.lower()
    words = (column, forward.lower(), way, SPACE_KEYS[structure])
    return "_".join([f"forward_nmse_chain{steps}", *filter(None, words)])
