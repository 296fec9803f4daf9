"""Outputs of the stages of the servoing testbed."""

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
from structlearn.tactile.touch_dataset import TEST, TEST_STRIDE, Chains, TouchDataset, chains
from structlearn.testbeds.servoing.files import OtherSkinTables
from structlearn.testbeds.servoing.protocol.model_scores import ModelScores, contact_errors
from structlearn.testbeds.servoing.protocol.servo_scores import ControllerScores
from structlearn.testbeds.servoing.protocol.servo_variants import (
    Comparison,
)

PUBLISHED = read_values(Path(__file__).with_name("published.yaml"))  # numbers as the dissertation prints them

STUDIES = ("people", "controller", "loss_weights")
"""What the page quotes of trials beside the pipeline, `benchmarks/studies/servoing`."""

PEOPLE_STUDY = "servoing/people"  # the study that verdicts stand on
AS_IT_STANDS = "as it stands"  # variant of a study in which nothing is changed


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
    def people(self) -> People:
        """All that is reported here, of several people, each with a sensor and models of their own."""
        return People(self.studies["people"], AS_IT_STANDS)

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
