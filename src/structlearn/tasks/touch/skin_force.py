"""How hard is the skin pressed? Forces read off its channels, at one place, learned from a scale.

A probe goes down and up again, several times a recording. Channels and scale lag behind the commanded depth,
each by its own time, which is found from the data of the recording that is learned from.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd

from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.readers.user_tables import TouchLog
from structlearn.tasks.touch.skin_readings import gaussian_process, joined, polynomial
from structlearn.tasks.touch.touch_names import NEW_PRESSES, NEW_RUN, PRESSURE, PROCESS, QUADRATIC
from structlearn.tasks.touch.touch_parameters import ForceParameters

PRESSURE_DEGREE = 4
"""Of the polynomial of the norm."""

LAG_STEP_S = 0.02
"""Lags are looked for at such steps, and between them along a parabola."""

LONGEST_GAP_S = 0.3
"""Between two readings of the skin; what the scale weighed in a longer one is left out."""

INNER_FOLDS = 3
"""Parts of the presses by which the ridge's penalty is chosen."""


@dataclass(frozen=True)
class WeighedPresses:
    """Readings of the scale: time (N,) s, channels at that depth with their norm (N, E + 1), force, press."""

    time: np.ndarray
    channels: np.ndarray
    force: np.ndarray
    press: np.ndarray

    def part(self, kept: np.ndarray) -> "WeighedPresses":
        """Those rows that are kept (N,)."""
        return WeighedPresses(*(values[kept] for values in vars(self).values()))


def force_errors(
    logs: Sequence[TouchLog], parameters: ForceParameters, known: int
) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Errors of forces on presses left out and on other recordings; a Gaussian process knows `known` presses.

    A recording whose scale says too little to leave a press out is left aside.

    Returns:
        Errors: `learned_from`, `asked_about`, `new`, `model`, `press`, `rms_n`, `worst_n`. Lags: `run`,
        `signals_s`, `force_s`, `readings` of the scale, `presses`. Traces on other recordings:
        `learned_from`, `asked_about`, `time_s`, `force_n` and `read_n` of `QUADRATIC`.

    Raises:
        InputError: a recording has no time or place.
    """
    runs = []
    for log in logs:
        if log.time is None or log.place is None or log.force is None:
            raise InputError(f"{log.name}: forces are learned with columns time_s, x_m, y_m, z_m and force_n")
        there = np.isfinite(log.force)
        count, force = 0, log.force[there]
        if (force > parameters.pressed_n).any():
            count = len(np.unique(press_numbers(log.time[there], force, parameters.pressed_n)))
        if count > INNER_FOLDS:
            runs.append(log)
        else:
            print(f"skin: {log.name} left aside: {count} presses on the scale are too few to leave some out")
    judge = partial(_run_errors, runs=runs, parameters=parameters, known=known)
    found = parallel_map(judge, runs, "forces", local=True)
    errors, lags, traces = (joined([table for one in found for table in one[part]]) for part in range(3))
    return errors, lags, traces


def _run_errors(
    run: TouchLog, runs: Sequence[TouchLog], parameters: ForceParameters, known: int
) -> tuple[list[pd.DataFrame], ...]:
    """Parts of the tables that come from what one recording teaches."""
    assert run.time is not None
    assert run.place is not None
    assert run.force is not None
    depth, strength, there = -run.place[:, 2], np.linalg.norm(run.counts, axis=1), np.isfinite(run.force)
    effects = {"signals_s": (run.time, strength), "force_s": (run.time[there], run.force[there])}
    lags = {
        name: lag_behind(run.time, depth, *effect, parameters.longest_lag_s)
        for name, effect in effects.items()
    }
    own = weighed_presses(run, lags, parameters.pressed_n)
    presses = np.unique(own.press)
    row = {"run": run.name} | lags | {"readings": len(own.force), "presses": len(presses)}
    errors, traces = [], []
    for press in presses:
        left_out = own.press == press
        models, asked = _models(own.part(~left_out), parameters), own.part(left_out)
        found = {model: read(asked.channels) for model, read in models.items()}
        errors.append(_press_errors(asked, found).assign(asked_about=run.name, new=NEW_PRESSES))
    models = _models(own, parameters) | {PROCESS: _process(own, known)}
    for other in (one for one in runs if one.name != run.name):
        asked = weighed_presses(other, lags, parameters.pressed_n)
        found = {model: read(asked.channels) for model, read in models.items()}
        errors.append(_press_errors(asked, found).assign(asked_about=other.name, new=NEW_RUN))
        trace = pd.DataFrame({"time_s": asked.time, "force_n": asked.force, "read_n": found[QUADRATIC]})
        traces.append(trace.assign(learned_from=run.name, asked_about=other.name))
    return [its.assign(learned_from=run.name) for its in errors], [pd.DataFrame([row])], traces


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


def weighed_presses(run: TouchLog, lags: Mapping[str, float], pressed: float) -> WeighedPresses:
    """Readings of the scale with the channels that belong to them, in presses that reach `pressed` N."""
    assert run.time is not None
    assert run.force is not None
    there = np.isfinite(run.force)
    time, force = run.time[there], run.force[there]
    at = time - lags["force_s"] + lags["signals_s"]
    after = np.searchsorted(run.time, at)
    inside = (after > 0) & (after < len(run.time))
    after = np.clip(after, 1, len(run.time) - 1)
    kept = inside & (run.time[after] - run.time[after - 1] <= LONGEST_GAP_S)
    channels = np.stack([np.interp(at, run.time, values) for values in run.counts.T], axis=1)
    channels = np.hstack([channels, np.linalg.norm(channels, axis=1, keepdims=True)])
    return WeighedPresses(time, channels, force, press_numbers(time, force, pressed)).part(kept)


def press_numbers(time: np.ndarray, force: np.ndarray, pressed: float) -> np.ndarray:
    """Number of the press (N,), from 0, that each reading belongs to: they part halfway between two."""
    on = (force > pressed).astype(int)
    starts, ends = np.flatnonzero(np.diff(on) > 0) + 1, np.flatnonzero(np.diff(on) < 0)
    starts = starts[1:] if on[0] == 0 else starts
    return np.searchsorted(0.5 * (time[ends[: len(starts)]] + time[starts]), time, side="right")


def _models(
    taught: WeighedPresses, parameters: ForceParameters
) -> dict[str, Callable[[np.ndarray], np.ndarray]]:
    strength = polynomial(taught.channels[:, -1:], taught.force, PRESSURE_DEGREE)
    return {
        QUADRATIC: _quadratic(taught, parameters.penalties),
        PRESSURE: lambda channels: strength(channels[:, -1:]),
    }


def _process(taught: WeighedPresses, known: int) -> Callable[[np.ndarray], np.ndarray]:
    middle, spread = taught.channels.mean(axis=0), taught.channels.std(axis=0)
    read = gaussian_process((taught.channels - middle) / spread, taught.force[:, None], known)
    return lambda channels: read((channels - middle) / spread)[:, 0]


def _quadratic(taught: WeighedPresses, penalties: Sequence[float]) -> Callable[[np.ndarray], np.ndarray]:
    """Ridge regression whose penalty does best on presses that are left out of those taught."""
    from sklearn.linear_model import Ridge
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import PolynomialFeatures, StandardScaler

    inputs = make_pipeline(StandardScaler(), PolynomialFeatures(2, include_bias=False), StandardScaler())
    seen, part = inputs.fit_transform(taught.channels), taught.press % INNER_FOLDS

    def missed(penalty: float) -> float:
        errors = [
            Ridge(penalty).fit(seen[part != one], taught.force[part != one]).predict(seen[part == one])
            - taught.force[part == one]
            for one in np.unique(part)
        ]
        return sum(np.square(error).sum() for error in errors)

    best = Ridge(min(penalties, key=missed))
    return make_pipeline(inputs, best).fit(taught.channels, taught.force).predict


def _press_errors(asked: WeighedPresses, found: Mapping[str, np.ndarray]) -> pd.DataFrame:
    """`model`, `press`, `rms_n`, `worst_n` of forces (N,) by model."""
    tables = []
    for model, force in found.items():
        error = pd.Series(np.abs(force - asked.force)).groupby(asked.press)
        columns = {"rms_n": error.apply(lambda its: np.sqrt(np.mean(its**2))), "worst_n": error.max()}
        tables.append(pd.DataFrame(columns).rename_axis("press").reset_index().assign(model=model))
    return pd.concat(tables, ignore_index=True)
