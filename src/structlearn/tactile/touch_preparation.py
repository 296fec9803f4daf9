"""From recordings of a finger that touches to samples: low-pass, offsets, contacts, splits (II.4.1.1)."""

from collections.abc import Mapping, Sequence

import numpy as np
from pydantic import Field, model_validator

from structlearn.core import quaternion, signals
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.readers.demonstration import Demonstration
from structlearn.tactile.electrodes import Skin
from structlearn.tactile.touch_dataset import (
    OTHER,
    ROTATION,
    TEST,
    TRAIN,
    TRANSLATION,
    VALIDATION,
    TouchDataset,
)

MOTIONS: Mapping[str | None, int] = {"rotation": ROTATION, "translation": TRANSLATION}
"""Numbers of what a recording's provenance calls its `motion`; all else is `OTHER`."""


class TouchDataParameters(Parameters):
    """From recorded counts and poses to samples."""

    rate_hz: float = Field(ge=10, le=1000)
    cutoff_hz: float = Field(gt=0)
    air_s: float = Field(gt=0)
    touched_counts: float = Field(gt=0)
    pressed_counts: float = Field(gt=0)
    contact_s: float = Field(gt=0)
    validation_share: float = Field(gt=0, lt=0.5)
    test_share: float = Field(gt=0, lt=0.5)
    seed: int = Field(ge=0)

    @model_validator(mode="after")
    def _thresholds_rise(self) -> "TouchDataParameters":
        if self.pressed_counts < self.touched_counts:
            raise ValueError("pressed_counts must not be below touched_counts")
        return self


def prepare(
    demonstrations: Sequence[Demonstration], skin: Skin, parameters: TouchDataParameters
) -> TouchDataset:
    """Samples of all contacts of all demonstrations, in their order.

    Splits are drawn by contact, evenly over the motions. `demonstrations`: with poses of the finger and
    counts, all at `rate_hz`. Raises InputError: there is no pose or no touch in a demonstration, its channels
    are not the skin's, it has another rate, nothing touches in it, it is shorter than the time in the air, or
    there are fewer than three contacts in all; the message names the demonstration.
    """
    parts = []
    count = 0
    for trial, demonstration in enumerate(demonstrations):
        for fields in _contacts(demonstration, skin, parameters):
            size = len(fields["pressure"])
            motion = MOTIONS.get(demonstration.provenance.get("motion"), OTHER)
            labels = {"contact": count, "trial": trial, "motion": motion}
            parts.append(fields | {name: np.full(size, value) for name, value in labels.items()})
            count += 1
    if count < 3:
        raise InputError(f"touch: three splits need three contacts, the recordings have {count}")
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    motions = np.array([part["motion"][0] for part in parts])
    return TouchDataset(
        signals=columns["signals"].astype(np.float32),
        pressure=columns["pressure"].astype(np.float32),
        contact_point=contact_points(columns["signals"], skin).astype(np.float32),
        velocity=columns["velocity"].astype(np.float32),
        orientation=columns["orientation"].astype(np.float32),
        contact=columns["contact"],
        pressed=columns["pressure"] >= parameters.pressed_counts,
        trial=columns["trial"],
        time=columns["time"].astype(np.float32),
        motion=columns["motion"],
        split=splits(motions, parameters)[columns["contact"]],
        rate_hz=np.array(parameters.rate_hz),
    )


def splits(motions: np.ndarray, parameters: TouchDataParameters) -> np.ndarray:
    """Split of every contact, (K,), at least one each for validation and test; evenly over motions (K,)."""
    rng = np.random.default_rng(parameters.seed)
    order = rng.permutation(len(motions))
    order = order[np.argsort(motions[order], kind="stable")]
    split = np.full(len(motions), TRAIN)
    for number, share in ((TEST, parameters.test_share), (VALIDATION, parameters.validation_share)):
        left = order[split[order] == TRAIN]
        size = max(1, round(share * len(motions)))
        split[left[((np.arange(size) + 0.5) * len(left) / size).astype(int)]] = number
    return split


def _contacts(
    demonstration: Demonstration, skin: Skin, parameters: TouchDataParameters
) -> list[dict[str, np.ndarray]]:
    """Signals, pressure, velocity, orientation and time of every contact of one demonstration."""
    tactile, turned = _checked(demonstration, skin, parameters)
    dt, cutoff = 1 / parameters.rate_hz, parameters.cutoff_hz
    air = round(parameters.air_s * parameters.rate_hz)
    offset = tactile[:air].mean(axis=0)
    signal = signals.low_pass(tactile - offset, dt, cutoff)
    pressure = -signal.mean(axis=1)
    orientation = quaternion.normalised(signals.low_pass(quaternion.sign_continuous(turned), dt, cutoff))
    velocity = np.hstack(
        [
            signals.derivative(signals.low_pass(demonstration.position, dt, cutoff), dt),
            quaternion.angular_velocity(orientation, dt),
        ]
    )
    touched = np.concatenate([[False], pressure >= parameters.touched_counts, [False]])
    edges = np.diff(touched.astype(int))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    long = ends - starts >= parameters.contact_s * parameters.rate_hz
    if not long.any():
        raise InputError(
            f"{demonstration.name}: nothing touches for {parameters.contact_s:g} s: the pressure, minus the "
            f"mean of the counts less their offset, is at most {pressure.max():.3g} counts"
        )
    whole = {
        "signals": signal,
        "pressure": pressure,
        "velocity": velocity,
        "orientation": orientation,
        "time": dt * np.arange(len(signal)),
    }
    return [
        {name: values[start:end] for name, values in whole.items()}
        for start, end in zip(starts[long], ends[long], strict=True)
    ]


def _checked(
    demonstration: Demonstration, skin: Skin, parameters: TouchDataParameters
) -> tuple[np.ndarray, np.ndarray]:
    """Counts (T, E) and orientation (T, 4) of a demonstration that is fit for use."""
    name = demonstration.name
    if demonstration.tactile is None:
        raise InputError(f"{name}: has no tactile signal; name its topic in the parameters")
    if demonstration.orientation is None:
        raise InputError(f"{name}: has no orientation, without which velocities have no frame of the finger")
    channels = demonstration.tactile.shape[1]
    if channels != len(skin.electrodes):
        raise InputError(
            f"{name}: has {channels} tactile channels, the skin '{skin.name}' {len(skin.electrodes)}"
        )
    if not np.isclose(demonstration.dt * parameters.rate_hz, 1.0, rtol=1e-6):
        raise InputError(f"{name}: has {1 / demonstration.dt:g} samples per s, not {parameters.rate_hz:g}")
    if not np.isfinite(demonstration.tactile).all():
        row, column = np.argwhere(~np.isfinite(demonstration.tactile))[0]
        value = demonstration.tactile[row, column]
        raise InputError(f"{name}: row {row}, electrode {column + 1}: value is {value}")
    shortest = max(parameters.air_s, parameters.contact_s) * parameters.rate_hz
    if len(demonstration.tactile) < max(shortest, 5):
        raise InputError(f"{name}: {len(demonstration.tactile)} samples are too few for air and a contact")
    return demonstration.tactile, demonstration.orientation


def contact_points(signals: np.ndarray, skin: Skin) -> np.ndarray:
    """Points of contact, estimated from the electrodes (Lin et al. 2013, II.3.3).

    Each is the centroid of the electrodes by their squared negative changes, projected to the skin. Only
    electrodes whose counts fell take part: there the fluid is thinned; where it bulges counts rise. `signals`
    (N, E) counts less their offset; `skin`: with the E electrodes. Returns (N, 3) m, frame of the finger.
    Raises InputError: the number of channels is not that of the electrodes, a value is NaN or infinite, or no
    electrode of a row fell, so that nothing touches; the message names the row, from 0.
    """
    if signals.ndim != 2 or signals.shape[1] != len(skin.electrodes):
        raise InputError(
            f"touch: signals have shape {signals.shape}, the skin '{skin.name}' has "
            f"{len(skin.electrodes)} electrodes"
        )
    if not np.isfinite(signals).all():
        row, column = np.argwhere(~np.isfinite(signals))[0]
        raise InputError(f"touch: row {row}, electrode {column + 1}: value is {signals[row, column]}")
    weight = np.minimum(signals, 0.0) ** 2
    total = weight.sum(axis=1)
    if not (total > 0).all():
        raise InputError(f"touch: row {np.argmin(total > 0)}: nothing touches, no electrode's counts fell")
    return skin.project(weight @ skin.electrodes / total[:, None])
