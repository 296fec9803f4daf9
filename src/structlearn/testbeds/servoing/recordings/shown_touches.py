"""Demonstrations of touch that recordings show, with what was made of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.ground.errors import InputError
from structlearn.ground.params import Parameters
from structlearn.recordings.demonstration import Demonstration
from structlearn.tactile.touch_dataset import TouchDataset


class ServoingViewParameters(Parameters):
    """What recordings of the servoing testbed show.

    Attributes:
        demonstrations: names of those that are shown; of recordings none of which is named so, as many from
            the first on.
        map_points: samples on the latent map.
        trials: closed loops, as far as their paths are kept.
    """

    demonstrations: tuple[str, ...] = ("rotation_4_1", "rotation_6_2", "translation_2_1", "translation_4_1")
    map_points: int = Field(default=6000, ge=1)
    trials: int = Field(default=3, ge=1)


@dataclass(frozen=True)
class ShownTouch:
    """A demonstration of T samples, of which N are of contacts.

    Attributes:
        demonstration: on the clock of the samples.
        signals: (T, E) counts less their offset.
        time: (N,) s since its start.
        contact: (N,) number of the contact, rising.
        contact_point: (N, 3) m, estimated, frame of the finger.
        pressure: (N,) counts.
        latent: (N, 3) in the networks' units: two of the map, one of pressure.
        truth: (T', ...) true contacts of a simulated demonstration, see
            `simulation.touch_demonstrator.true_contacts`; otherwise empty.
    """

    demonstration: Demonstration
    signals: np.ndarray
    time: np.ndarray
    contact: np.ndarray
    contact_point: np.ndarray
    pressure: np.ndarray
    latent: np.ndarray
    truth: pd.DataFrame

    @property
    def name(self) -> str:
        """Of the demonstration."""
        return self.demonstration.name


def shown_touches(
    demonstrations: Sequence[Demonstration],
    dataset: TouchDataset,
    latent_map: pd.DataFrame,
    truth: pd.DataFrame,
    names: Sequence[str],
    air_s: float,
) -> list[ShownTouch]:
    """The demonstrations of these names, with their samples.

    Args:
        demonstrations: all of them, in the order in which the dataset numbers them.
        dataset: samples of their contacts.
        latent_map: a row for each sample, see `tactile.latent_evaluation.latent_map`.
        truth: true contacts of all of them, or none.
        names: which are wanted; see `ServoingViewParameters`.
        air_s: at the start of each, in the air; counts there are the offset.

    Raises:
        InputError: there is no demonstration of such a name.
    """
    numbers = {one.name: number for number, one in enumerate(demonstrations)}
    if not any(one.simulated for one in demonstrations) and numbers.keys().isdisjoint(names):
        names = list(numbers)[: len(names)]
    unknown = [name for name in names if name not in numbers]
    if unknown:
        raise InputError(
            f"inspect_servoing.demonstrations: there is no '{unknown[0]}', only {', '.join(sorted(numbers))}"
        )
    return [
        _shown(
            demonstrations[numbers[name]],
            dataset,
            np.flatnonzero(dataset.trial == numbers[name]),
            latent_map,
            truth[truth["trial"] == name],
            air_s,
        )
        for name in names
    ]


def _shown(
    demonstration: Demonstration,
    dataset: TouchDataset,
    rows: np.ndarray,
    latent_map: pd.DataFrame,
    truth: pd.DataFrame,
    air_s: float,
) -> ShownTouch:
    air = max(round(air_s / demonstration.dt), 1)
    return ShownTouch(
        demonstration=demonstration,
        signals=demonstration.tactile - demonstration.tactile[:air].mean(axis=0),
        time=dataset.time[rows].astype(float),
        contact=dataset.contact[rows],
        contact_point=dataset.contact_point[rows].astype(float),
        pressure=dataset.pressure[rows].astype(float),
        latent=latent_map.iloc[rows][["x", "y", "z"]].to_numpy(float),
        truth=truth,
    )
