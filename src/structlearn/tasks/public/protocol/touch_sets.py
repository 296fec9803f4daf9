"""Sets of touches to learn latent spaces from: recorded slides and logs of unscrewing, simulated touches.

What the counts mean differs. In the logs of unscrewing they rise under pressure: the contact force that a
log itself holds rises with their mean (correlation 0.98 and more), so their sign is turned. The slides were
published as magnitudes of change: none is below zero. Which way an electrode changed is lost, so each is
taken for pressed, and magnitudes are compared with magnitudes.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from structlearn.core import quaternion, signals
from structlearn.core.errors import MissingInputError
from structlearn.core.params import Parameters
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.slide import material_of
from structlearn.tactile.electrodes import Skin
from structlearn.tactile.geodesics import Geodesics, geodesics
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentSpaceParameters
from structlearn.tactile.touch_dataset import OTHER, TEST, TRAIN, TouchDataset
from structlearn.tactile.touch_preparation import contact_points

RECORDED = (SLIDES, UNSCREWING) = ("slides", "unscrewing")
SIMULATED = "simulated"
MAGNITUDES = "simulated, magnitudes"
"""Simulated touches of which only the magnitudes of the changes are kept, as of the slides."""

PARTNERS = {SLIDES: MAGNITUDES, MAGNITUDES: SLIDES, UNSCREWING: SIMULATED, SIMULATED: UNSCREWING}
"""Per set, the one that is tested on after it was learned from."""


class LatentTouchParameters(Parameters):
    """Latent spaces of recorded touch."""

    faulty: tuple[str, ...]
    folds: int = Field(ge=2)
    simulated_repeats: int = Field(ge=1)
    geodesics: GeodesicParameters
    spaces: LatentSpaceParameters


@dataclass(frozen=True)
class TouchSet:
    """Touches of one origin.

    Attributes:
        name: of the set.
        samples: all of them; their split does not count.
        geodesics: bins of them and their distances.
        groups: per trial, what was touched.
    """

    name: str
    samples: TouchDataset
    geodesics: Geodesics
    groups: tuple[str, ...]

    def without(self, trials: Sequence[int] | np.ndarray) -> TouchDataset:
        """The samples with these trials as the test split, all others to be learned from."""
        return replace(self.samples, split=np.where(np.isin(self.samples.trial, trials), TEST, TRAIN))


def held_touch(demonstrations: Sequence[Demonstration], skin: Skin, cutoff_hz: float) -> TouchDataset:
    """Samples of trials in which something touches from start to end; every trial is one contact.

    Raises:
        InputError: the number of electrodes is not the skin's, or nothing touches in a sample.
    """
    parts = []
    for number, one in enumerate(demonstrations):
        orientation = quaternion.normalised(signals.low_pass(one.signal("orientation"), one.dt, cutoff_hz))
        position = signals.low_pass(one.position, one.dt, cutoff_hz)
        velocity = signals.derivative(position, one.dt), quaternion.angular_velocity(orientation, one.dt)
        parts.append(
            {
                "signals": -signals.low_pass(one.signal("tactile"), one.dt, cutoff_hz),
                "velocity": np.hstack(velocity),
                "orientation": orientation,
                "time": one.time,
                "trial": np.full(len(one.time), number),
            }
        )
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    trial = columns.pop("trial")
    found = {name: values.astype(np.float32) for name, values in columns.items()}
    return TouchDataset(
        **found,
        pressure=-found["signals"].mean(axis=1),
        contact_point=contact_points(found["signals"], skin).astype(np.float32),
        contact=trial,
        trial=trial,
        pressed=np.full(len(trial), True),
        motion=np.full(len(trial), OTHER),
        split=np.full(len(trial), TRAIN),
        rate_hz=np.array(1 / demonstrations[0].dt),
    )


def magnitudes(samples: TouchDataset, skin: Skin) -> TouchDataset:
    """The same touches when the directions of the changes are lost: every electrode is taken for pressed."""
    found = -np.abs(samples.signals)
    points = contact_points(found, skin).astype(np.float32)
    return replace(samples, signals=found, pressure=-found.mean(axis=1), contact_point=points)


def touch_sets(
    slides: Sequence[Demonstration],
    unscrewing: Sequence[Demonstration],
    simulated: TouchDataset,
    skin: Skin,
    cutoff_hz: float,
    faulty: Collection[str],
    parameters: GeodesicParameters,
) -> list[TouchSet]:
    """Recorded sets that have several trials, and their partners, with their distances on the skin.

    A set of which the skin cannot be told, for it has too few samples or patches too far apart, is left aside
    with its partner.

    Raises:
        MissingInputError: no set is left.
    """
    sound = [one for one in slides if one.name not in faulty]
    trials = {
        SLIDES: (sound, [material_of(one.name) for one in sound]),
        UNSCREWING: (unscrewing, [one.name for one in unscrewing]),
    }
    found = {
        name: (held_touch(its, skin, cutoff_hz), groups)
        for name, (its, groups) in trials.items()
        if len(its) > 1
    }
    handle = ["handle"] * (int(simulated.trial.max()) + 1)
    found[SIMULATED] = simulated, handle
    found[MAGNITUDES] = magnitudes(simulated, skin), handle
    sets = {}
    for name, (samples, groups) in found.items():
        try:
            distances = geodesics(samples.contact_point, parameters)
        except MissingInputError as missing:
            print(f"latent touch: {name} left aside: {missing}")
        else:
            sets[name] = TouchSet(name, samples, distances, tuple(groups))
    paired = [its for name, its in sets.items() if PARTNERS[name] in sets]
    if not paired:
        raise MissingInputError("there are no two slides or logs of unscrewing whose touches make a map")
    return paired
