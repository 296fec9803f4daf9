"""How hard is the skin pressed? Forces read off its channels, at one place, learned from a scale.

A probe goes down and up again, ten times a run. Channels and scale lag behind the commanded depth, each by
its own time, which is found from the data of the run that is learned from.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd

from structlearn.ground.errors import InputError
from structlearn.ground.parallel import parallel_map
from structlearn.recordings.touch_log import TouchLog
from structlearn.tasks.skin_readings import NEW_RUN, PROCESS, gaussian_process, polynomial
from structlearn.tasks.touch_parameters import TouchParameters

QUADRATIC, PRESSURE = "channels and their products", "pressure alone"
"""Models beside the Gaussian process: ridge regression on 16 channels and their products, and a polynomial of
the norm of all channels, which is the contact pressure of this sensor."""

NEW_PRESSES = "new presses"

PRESSURE_DEGREE = 4
"""Of the polynomial of the norm."""

LAG_STEP_S = 0.02
"""Lags are looked for at such steps, and between them along a parabola."""

LONGEST_GAP_S = 0.3
"""Between two readings of the skin; what the scale weighed in a longer one is left out."""

INNER_FOLDS = 3
"""Parts of the presses by which the ridge's penalty is chosen."""


@dataclass(frozen=True)
class Lags:
    """s by which channels and scale of a run lag behind the commanded depth."""

    signals: float
    force: float


@dataclass(frozen=True)
class WeighedPresses:
    """N readings of the scale with the channels at the same depth.

    Attributes:
        time: (N,) s of the scale.
        channels: (N, E + 1) readings and their norm.
        force: (N,) N.
        press: (N,) number of the press.
    """

    time: np.ndarray
    channels: np.ndarray
    force: np.ndarray
    press: np.ndarray

    def part(self, kept: np.ndarray) -> "WeighedPresses":
        """Those rows that are kept (N,)."""
        return WeighedPresses(*(values[kept] for values in vars(self).values()))


def force_errors(
    runs: Sequence[TouchLog], parameters: TouchParameters
) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Errors of forces on presses left out and on other runs.

    A run whose scale says too little to leave a press out is left aside.

    Returns:
        Errors: `learned_from`, `asked_about`, `new`, `model`, `press`, `rms_n`, `worst_n`. Lags: `run`,
        `signals_s`, `force_s`, `readings` of the scale, `presses`. Traces on other runs: `learned_from`,
        `asked_about`, `time_s`, `force_n` and `read_n` of `QUADRATIC`.
    """
    assert parameters.force is not None
    counts = {run.name: press_count(run, parameters.force.pressed_n) for run in runs}
    for name, count in counts.items():
        if count <= INNER_FOLDS:
            print(f"skin: {name} left aside: {count} presses on the scale are too few to leave some out")
    runs = [run for run in runs if counts[run.name] > INNER_FOLDS]
    found = parallel_map(partial(_run_errors, runs=runs, parameters=parameters), runs, "forces", local=True)
    errors, lags, traces = (
        [table for one in found for table in one[part]] for part in ("errors", "lags", "traces")
    )
    return tuple(
        pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()
        for tables in (errors, lags, traces)
    )


def _run_errors(
    run: TouchLog, runs: Sequence[TouchLog], parameters: TouchParameters
) -> dict[str, list[pd.DataFrame]]:
    """Parts of the tables that come from what one run teaches."""
    assert parameters.force is not None
    lag = run_lags(run, parameters.force.longest_lag_s)
    own = weighed_presses(run, lag, parameters.force.pressed_n)
    presses = np.unique(own.press)
    lags = {"run": run.name, "signals_s": lag.signals, "force_s": lag.force}
    lags |= {"readings": len(own.force), "presses": len(presses)}
    errors, traces = [], []
    for press in presses:
        left_out = own.press == press
        for model, read in _models(own.part(~left_out), parameters, with_process=False).items():
            table = _press_errors(own.part(left_out), read(own.channels[left_out]))
            errors.append(_named(table, run, run, NEW_PRESSES, model))
    models = _models(own, parameters, with_process=True)
    for other in (one for one in runs if one.name != run.name):
        asked = weighed_presses(other, lag, parameters.force.pressed_n)
        found = {model: read(asked.channels) for model, read in models.items()}
        for model, force in found.items():
            errors.append(_named(_press_errors(asked, force), run, other, NEW_RUN, model))
        trace = pd.DataFrame({"time_s": asked.time, "force_n": asked.force, "read_n": found[QUADRATIC]})
        traces.append(trace.assign(learned_from=run.name, asked_about=other.name))
    return {"errors": errors, "lags": [pd.DataFrame([lags])], "traces": traces}


def run_lags(run: TouchLog, longest: float) -> Lags:
    """Lags of channels and scale behind the commanded depth, by the largest correlation."""
    time, place, force = _on_scale(run)
    depth, weighed = -place[:, 2], np.isfinite(force)
    strength = np.linalg.norm(run.counts, axis=1)
    return Lags(
        lag_behind(time, depth, time, strength, longest),
        lag_behind(time, depth, time[weighed], force[weighed], longest),
    )


def _on_scale(run: TouchLog) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, place and force of a recording that has them.

    Raises:
        InputError: it has no time or place.
    """
    if run.time is None or run.place is None or run.force is None:
        raise InputError(f"{run.name}: forces are learned with columns time_s, x_m, y_m, z_m and force_n")
    return run.time, run.place, run.force


def lag_behind(
    cause_time: np.ndarray, cause: np.ndarray, time: np.ndarray, effect: np.ndarray, longest: float
) -> float:
    """Lag of maximum cross-correlation, in s, 0 to `longest`, of an effect (M,) and its cause (N,)."""
    grid = np.arange(cause_time[0], cause_time[-1] - longest, LAG_STEP_S)
    known = np.interp(grid, cause_time, cause)
    lags = np.arange(-LAG_STEP_S, longest + 1.5 * LAG_STEP_S, LAG_STEP_S)
    alike = [np.corrcoef(known, np.interp(grid + lag, time, effect))[0, 1] for lag in lags]
    best = int(np.clip(np.argmax(alike), 1, len(lags) - 2))
    before, here, after = alike[best - 1 : best + 2]
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend < 0 else 0.0
    return float(np.clip(lags[best] + LAG_STEP_S * shift, 0.0, longest))


def weighed_presses(run: TouchLog, lags: Lags, pressed: float) -> WeighedPresses:
    """Readings of the scale with the channels that belong to them; a press reaches `pressed` N at least."""
    clock, _, weight = _on_scale(run)
    weighed = np.isfinite(weight)
    time, force = clock[weighed], weight[weighed]
    at = time - lags.force + lags.signals
    after = np.searchsorted(clock, at)
    inside = (after > 0) & (after < len(clock))
    after = np.clip(after, 1, len(clock) - 1)
    kept = inside & (clock[after] - clock[after - 1] <= LONGEST_GAP_S)
    channels = np.stack([np.interp(at, clock, values) for values in run.counts.T], axis=1)
    channels = np.hstack([channels, np.linalg.norm(channels, axis=1, keepdims=True)])
    found = WeighedPresses(time, channels, force, press_numbers(time, force, pressed))
    return found.part(kept)


def press_count(run: TouchLog, pressed: float) -> int:
    """Presses of a run that the scale weighed."""
    clock, _, weight = _on_scale(run)
    weighed = np.isfinite(weight)
    time, force = clock[weighed], weight[weighed]
    return len(np.unique(press_numbers(time, force, pressed))) if (force > pressed).any() else 0


def press_numbers(time: np.ndarray, force: np.ndarray, pressed: float) -> np.ndarray:
    """Number of the press (N,), from 0, that each reading belongs to: they part halfway between two."""
    on = (force > pressed).astype(int)
    starts, ends = np.flatnonzero(np.diff(on) > 0) + 1, np.flatnonzero(np.diff(on) < 0)
    starts = starts[1:] if on[0] == 0 else starts
    return np.searchsorted(0.5 * (time[ends[: len(starts)]] + time[starts]), time, side="right")


def _models(
    taught: WeighedPresses, parameters: TouchParameters, with_process: bool
) -> dict[str, Callable[[np.ndarray], np.ndarray]]:
    assert parameters.force is not None
    strength = polynomial(taught.channels[:, -1:], taught.force, PRESSURE_DEGREE)
    models = {
        QUADRATIC: _quadratic(taught, parameters.force.penalties),
        PRESSURE: lambda channels: strength(channels[:, -1:]),
    }
    if with_process:
        middle, spread = taught.channels.mean(axis=0), taught.channels.std(axis=0)
        process = gaussian_process(
            (taught.channels - middle) / spread, taught.force[:, None], parameters.rival_samples
        )
        models[PROCESS] = lambda channels: process((channels - middle) / spread)[:, 0]
    return models


def _quadratic(taught: WeighedPresses, penalties: Sequence[float]) -> Callable[[np.ndarray], np.ndarray]:
    """Ridge regression whose penalty does best on presses that are left out of those taught."""
    from sklearn.linear_model import Ridge
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import PolynomialFeatures, StandardScaler

    inputs = make_pipeline(StandardScaler(), PolynomialFeatures(2, include_bias=False), StandardScaler())
    seen, part = inputs.fit_transform(taught.channels), taught.press % INNER_FOLDS
    missed = [
        sum(
            np.square(
                Ridge(penalty).fit(seen[part != one], taught.force[part != one]).predict(seen[part == one])
                - taught.force[part == one]
            ).sum()
            for one in np.unique(part)
        )
        for penalty in penalties
    ]
    return (
        make_pipeline(inputs, Ridge(penalties[int(np.argmin(missed))]))
        .fit(taught.channels, taught.force)
        .predict
    )


def _press_errors(asked: WeighedPresses, read: np.ndarray) -> pd.DataFrame:
    error = pd.Series(read - asked.force).groupby(asked.press)
    table = pd.DataFrame(
        {
            "rms_n": error.apply(lambda its: np.sqrt(np.mean(its**2))),
            "worst_n": error.apply(lambda its: its.abs().max()),
        }
    )
    return table.rename_axis("press").reset_index()


def _named(table: pd.DataFrame, run: TouchLog, other: TouchLog, new: str, model: str) -> pd.DataFrame:
    return table.assign(learned_from=run.name, asked_about=other.name, new=new, model=model)
