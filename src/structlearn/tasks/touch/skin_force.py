"""Contact force estimated from the channels of a tactile skin, learned from readings of a scale.

In each recording a probe is pressed into the skin several times at one place. Channels and scale lag behind
the commanded depth; both lags are estimated from what the models learn from.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd

from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.readers.touch_log import TouchLog
from structlearn.tasks.touch.parameters import ForceParameters
from structlearn.tasks.touch.skin_readings import gaussian_process, polynomial
from structlearn.tasks.touch.touch_names import NEW_PRESSES, NEW_RUN, PRESSURE, PROCESS, QUADRATIC

PRESSURE_DEGREE = 4  # of the polynomial of the channels' norm
LAG_STEP_S = 0.02  # grid of lags; the best one is refined by a parabola
LONGEST_GAP_S = 0.3  # between two readings of the skin; scale readings within a longer gap are left out
INNER_FOLDS = 3  # of the presses, in cross-validation of the ridge penalty

Estimate = Callable[[np.ndarray], np.ndarray]  # forces (N,) of channels (N, E + 1)


class Strokes(NamedTuple):
    """A recording of presses at one place."""

    name: str
    time: np.ndarray  # (N,) s
    depth: np.ndarray  # (N,) m, commanded
    counts: np.ndarray  # (N, E)
    weighed_s: np.ndarray  # (M,) times of the scale
    force: np.ndarray  # (M,) N


class WeighedPresses(NamedTuple):
    """Readings of the scale, each with the channels at the same depth."""

    time: np.ndarray  # (N,) s
    channels: np.ndarray  # (N, E + 1), the last is their norm
    force: np.ndarray  # (N,) N
    press: np.ndarray  # (N,) number of the press

    def part(self, kept: np.ndarray) -> "WeighedPresses":
        """Rows selected by a mask (N,)."""
        return WeighedPresses(*(values[kept] for values in self))


def force_errors(
    logs: Sequence[TouchLog], parameters: ForceParameters, known: int
) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Force errors on presses held out and on other recordings; the Gaussian process learns `known` presses.

    Recordings with too few weighed presses to hold one out are skipped.

    Returns:
        Errors: `learned_from`, `test_run`, `new`, `model`, `press`, `rms_n`, `worst_n`. Lags: `run`,
        `signals_s`, `force_s`, `readings` of the scale, `presses`. Traces on other recordings:
        `learned_from`, `test_run`, `time_s`, `force_n` and `read_n` of `QUADRATIC`.

    Raises:
        InputError: a recording has no time or place.
    """
    runs = []
    for log in logs:
        if log.time is None or log.place is None or log.force is None:
            raise InputError(f"{log.name}: forces are learned with columns time_s, x_m, y_m, z_m and force_n")
        there = np.isfinite(log.force)
        time, force, count = log.time[there], log.force[there], 0
        if (force > parameters.pressed_n).any():
            count = len(np.unique(press_numbers(time, force, parameters.pressed_n)))
        if count > INNER_FOLDS:
            runs.append(Strokes(log.name, log.time, -log.place[:, 2], log.counts, time, force))
        else:
            print(f"skin: {log.name} left aside: {count} presses on the scale are too few to leave some out")
    judge = partial(_run_errors, runs=runs, parameters=parameters, known=known)
    judged = parallel_map(judge, runs, "forces", local=True)
    parts = ([table for tables in judged for table in tables[part]] for part in range(3))
    errors, lags, traces = (
        pd.concat(tables, ignore_index=True) if tables else pd.DataFrame() for tables in parts
    )
    return errors, lags, traces


def _run_errors(
    run: Strokes, runs: Sequence[Strokes], parameters: ForceParameters, known: int
) -> tuple[list[pd.DataFrame], ...]:
    """Tables of errors, lags and traces of what is learned from one recording."""
    number = press_numbers(run.weighed_s, run.force, parameters.pressed_n)
    lags = _lags(run, parameters.longest_lag_s)
    own = weighed_presses(run, lags, parameters.pressed_n)
    presses = np.unique(own.press)
    row = {"run": run.name} | lags | {"readings": len(own.force), "presses": len(presses)}
    errors, traces = [], []
    for press in presses:
        span = run.weighed_s[number == press]
        others = _lags(run, parameters.longest_lag_s, (span[0], span[-1]))
        lagging = weighed_presses(run, others, parameters.pressed_n)
        left_out = lagging.press == press
        models = _models(lagging.part(~left_out), parameters.penalties)
        table, _ = _press_errors(lagging.part(left_out), models)
        errors.append(table.assign(test_run=run.name, new=NEW_PRESSES))
    models = _models(own, parameters.penalties) | {PROCESS: _process(own, known)}
    for other in (another for another in runs if another.name != run.name):
        tested = weighed_presses(other, lags, parameters.pressed_n)
        table, forces = _press_errors(tested, models)
        errors.append(table.assign(test_run=other.name, new=NEW_RUN))
        trace = pd.DataFrame({"time_s": tested.time, "force_n": tested.force, "read_n": forces[QUADRATIC]})
        traces.append(trace.assign(learned_from=run.name, test_run=other.name))
    return [table.assign(learned_from=run.name) for table in errors], [pd.DataFrame([row])], traces


def _lags(run: Strokes, longest: float, left_out: tuple[float, float] | None = None) -> dict[str, float]:
    """Lags of channels and scale behind the depth, without the press between two times."""
    effects = {
        "signals_s": (run.time, np.linalg.norm(run.counts, axis=1)),
        "force_s": (run.weighed_s, run.force),
    }
    return {
        name: lag_behind(run.time, run.depth, *effect, longest, left_out) for name, effect in effects.items()
    }


def lag_behind(
    cause_time: np.ndarray,
    cause: np.ndarray,
    time: np.ndarray,
    effect: np.ndarray,
    longest: float,
    left_out: tuple[float, float] | None = None,
) -> float:
    """Lag of maximum cross-correlation, in s, 0 to `longest`, of an effect (M,) behind its cause (N,).

    `left_out`: start and end in s of what is not compared, at any lag.
    """
    grid = np.arange(cause_time[0], cause_time[-1] - longest, LAG_STEP_S)
    if left_out is not None:
        start, end = left_out
        grid = grid[(grid < start - longest - 1.5 * LAG_STEP_S) | (grid > end + LAG_STEP_S)]
    known = np.interp(grid, cause_time, cause)
    lags = np.arange(-LAG_STEP_S, longest + 1.5 * LAG_STEP_S, LAG_STEP_S)
    alike = [np.corrcoef(known, np.interp(grid + lag, time, effect))[0, 1] for lag in lags]
    best = int(np.clip(np.argmax(alike), 1, len(lags) - 2))
    before, here, after = alike[best - 1 : best + 2]
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend < 0 else 0.0
    return float(np.clip(lags[best] + LAG_STEP_S * shift, 0.0, longest))


def weighed_presses(run: Strokes, lags: Mapping[str, float], pressed: float) -> WeighedPresses:
    """Readings of the scale with the channels at the same depth, in presses that reach `pressed` N."""
    at = run.weighed_s - lags["force_s"] + lags["signals_s"]
    after = np.searchsorted(run.time, at)
    inside = (after > 0) & (after < len(run.time))
    after = np.clip(after, 1, len(run.time) - 1)
    kept = inside & (run.time[after] - run.time[after - 1] <= LONGEST_GAP_S)
    channels = np.stack([np.interp(at, run.time, values) for values in run.counts.T], axis=1)
    channels = np.hstack([channels, np.linalg.norm(channels, axis=1, keepdims=True)])
    press = press_numbers(run.weighed_s, run.force, pressed)
    return WeighedPresses(run.weighed_s, channels, run.force, press).part(kept)


def press_numbers(time: np.ndarray, force: np.ndarray, pressed: float) -> np.ndarray:
    """Number of the press (N,), from 0, of each reading; presses are split halfway between two."""
    on = (force > pressed).astype(int)
    starts, ends = np.flatnonzero(np.diff(on) > 0) + 1, np.flatnonzero(np.diff(on) < 0)
    starts = starts[1:] if on[0] == 0 else starts
    return np.searchsorted(0.5 * (time[ends[: len(starts)]] + time[starts]), time, side="right")


def _models(training: WeighedPresses, penalties: Sequence[float]) -> dict[str, Estimate]:
    strength = polynomial(training.channels[:, -1:], training.force, PRESSURE_DEGREE)
    return {
        QUADRATIC: _quadratic(training, penalties),
        PRESSURE: lambda channels: strength(channels[:, -1:]),
    }


def _process(training: WeighedPresses, known: int) -> Estimate:
    middle, spread = training.channels.mean(axis=0), training.channels.std(axis=0)
    read = gaussian_process((training.channels - middle) / spread, training.force[:, None], known)
    return lambda channels: read((channels - middle) / spread)[:, 0]


def _quadratic(training: WeighedPresses, penalties: Sequence[float]) -> Estimate:
    """Ridge regression with the penalty that is best on training presses left out in turn."""
    from sklearn.linear_model import Ridge
    from sklearn.pipeline import Pipeline, make_pipeline
    from sklearn.preprocessing import PolynomialFeatures, StandardScaler

    def regression(penalty: float) -> Pipeline:
        inputs = StandardScaler(), PolynomialFeatures(2, include_bias=False), StandardScaler()
        return make_pipeline(*inputs, Ridge(penalty))

    part = training.press % INNER_FOLDS

    def missed(penalty: float) -> float:
        squares = 0.0
        for number in np.unique(part):
            known, tested = training.part(part != number), training.part(part == number)
            read = regression(penalty).fit(known.channels, known.force).predict
            squares += np.square(read(tested.channels) - tested.force).sum()
        return squares

    return regression(min(penalties, key=missed)).fit(training.channels, training.force).predict


def _press_errors(
    tested: WeighedPresses, models: Mapping[str, Estimate]
) -> tuple[pd.DataFrame, dict[str, np.ndarray]]:
    """Table of `model`, `press`, `rms_n` and `worst_n`, and the estimated forces (N,) by model."""
    tables, forces = [], {model: estimate(tested.channels) for model, estimate in models.items()}
    for model, force in forces.items():
        error = pd.Series(np.abs(force - tested.force)).groupby(tested.press)
        columns = {"rms_n": error.apply(lambda column: np.sqrt(np.mean(column**2))), "worst_n": error.max()}
        tables.append(pd.DataFrame(columns).rename_axis("press").reset_index().assign(model=model))
    return pd.concat(tables, ignore_index=True), forces
