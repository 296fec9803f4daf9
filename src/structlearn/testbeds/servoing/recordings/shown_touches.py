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
from structlearn.testbeds.servoing.names import ESTIMATED, TRUE
from structlearn.testbeds.servoing.recordings.servoing_scene import Contact, FingerMotion


class ServoingViewParameters(Parameters):
    """What recordings of the servoing testbed show."""

    demonstrations: tuple[str, ...]
    map_points: int = Field(ge=1)
    trials: int = Field(ge=1)


@dataclass(frozen=True)
class ShownTouch:
    """A demonstration of T samples, of which N are of contacts."""

    demonstration: Demonstration  # on the clock of the samples
    motion: FingerMotion  # the same, with counts less their offset
    rows: np.ndarray  # (N,) samples of the demonstration that are of contacts
    contact: np.ndarray  # (N,) number of the contact, rising
    contact_point: np.ndarray  # (N, 3) m, estimated, frame of the finger
    pressure: np.ndarray  # (N,) counts
    latent: np.ndarray  # (N, 3) in the networks' units: two of the map, one of pressure
    truth: pd.DataFrame  # true contacts, see `simulation.touch_demonstrator.true_contacts`

    @property
    def name(self) -> str:
        """Of the demonstration."""
        return self.demonstration.name

    @property
    def time(self) -> np.ndarray:
        """Times (N,) s of the samples of contacts."""
        return self.motion.time[self.rows]

    @property
    def contacts(self) -> list[Contact]:
        """The estimated contact over the whole time, and the true one."""
        point, touching = np.zeros((len(self.motion.time), 3)), np.zeros(len(self.motion.time), dtype=bool)
        point[self.rows], touching[self.rows] = self.contact_point, True
        time, load = (self.truth[name].to_numpy(float) for name in ("time_s", "load_n"))
        true = self.truth[["x_m", "y_m", "z_m"]].to_numpy(float)
        return [
            Contact("estimated", ESTIMATED, self.motion.time, point, touching),
            Contact("true", TRUE, time, true, load > 0),
        ]


def shown_touches(
    demonstrations: Sequence[Demonstration],
    dataset: TouchDataset,
    latent_map: pd.DataFrame,
    truth: pd.DataFrame,
    names: Sequence[str],
    air_s: float,
) -> list[ShownTouch]:
    """The demonstrations of these names, with their samples.

    `demonstrations`: all of them, in the order in which the dataset numbers them; `dataset`: samples of their
    contacts; `latent_map`: a row for each sample, see `tactile.latent_evaluation.latent_map`; `names`: which
    are wanted; see `ServoingViewParameters`; `air_s`: at the start of each, in the air; counts there are the
    offset.

    Raises:
        InputError: there is no demonstration of such a name.
    """
    numbers = {one.name: number for number, one in enumerate(demonstrations)}
    if unknown := [name for name in names if name not in numbers]:
        raise InputError(
            f"inspect_servoing.demonstrations: there is no '{unknown[0]}', only {', '.join(sorted(numbers))}"
        )
    found = []
    for name in names:
        one, rows = demonstrations[numbers[name]], np.flatnonzero(dataset.trial == numbers[name])
        air = max(round(air_s / one.dt), 1)
        tactile = one.signal("tactile")
        signals = tactile - tactile[:air].mean(axis=0)
        found.append(
            ShownTouch(
                demonstration=one,
                motion=FingerMotion(one.time, one.position, one.signal("orientation"), signals),
                rows=np.rint(dataset.time[rows].astype(float) / one.dt).astype(int),
                contact=dataset.contact[rows],
                contact_point=dataset.contact_point[rows].astype(float),
                pressure=dataset.pressure[rows].astype(float),
                latent=latent_map.iloc[rows][["x", "y", "z"]].to_numpy(float),
                truth=truth[truth["trial"] == name],
            )
        )
    return found
