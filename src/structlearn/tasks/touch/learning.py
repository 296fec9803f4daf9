"""Learning from a task's touches: a skin and its map, or expected traces of slides (II, IV.6)."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from structlearn.core.parallel import parallel_map
from structlearn.primitives.primitive_files import write_vector_primitive
from structlearn.readers.demonstration import read_streams
from structlearn.readers.touch_log import TouchLog, read_touch_logs
from structlearn.tactile.latent_models import TrainedTouch, write_latent_models
from structlearn.tactile.latent_parameters import STRUCTURES, InverseModel
from structlearn.tactile.pressed_skin import PLANE, STEP_S, PressedSkin, servo_on_table
from structlearn.tactile.servo_controller import (
    AdaptiveServo,
    ModelTrust,
    ServoParameters,
    TactileServo,
)
from structlearn.tasks.task_files import TaskFiles, write_tables
from structlearn.tasks.touch.parameters import TouchParameters
from structlearn.tasks.touch.skin_force import force_errors
from structlearn.tasks.touch.skin_readings import place_errors
from structlearn.tasks.touch.skin_touches import NEVER_VARIES, Touches, folds_of, gathered, learn_skin
from structlearn.tasks.touch.skin_within_runs import within_runs
from structlearn.tasks.touch.surface_traces import learn_surfaces
from structlearn.tasks.touch.touch_names import ADAPTIVE, PLAIN, PUBLISHED_SERVO, STRUCTURED

SPREAD = 0.5  # of the likely actions; range over which the adaptive controller takes slopes


def learn(files: TaskFiles, folder: Path) -> None:
    """Write tables, and models of the skin or the expected traces."""
    parameters = files.entry(TouchParameters)
    if parameters.surfaces is not None:
        streams = read_streams(files.recorded / "streams.parquet")
        expected, tables = learn_surfaces(streams, parameters.surfaces)
        write_vector_primitive(expected, folder / "expected.safetensors", "electrode counts without offset")
    else:
        skins, tables = learn_touch(read_touch_logs(files.recorded / "touches.parquet"), parameters)
        for name, skin in skins.items():
            write_latent_models(
                *skin, folder / ("models" if parameters.apart else "") / f"{name}.safetensors"
            )
    write_tables(tables, folder)


def learn_touch(
    logs: Sequence[TouchLog], parameters: TouchParameters
) -> tuple[dict[str, TrainedTouch], dict[str, pd.DataFrame]]:
    """Learn from all touches and test on the data held out.

    Recordings with a force are for forces alone: their probe stays at one place.

    Returns:
        Skins by the recording that each was learned from, or `TOGETHER`. Tables that have rows, by name:
        `recordings` (`gathered`), `errors`, `map` and `maps` (`place_errors`, on blocks held out and on other
        runs), `servo`, `paths` (`servo_trials`), `force`, `lags`, `traces` (`force_errors`), `published`,
        `rivals` (`within_runs`).

    Raises:
        InputError: recordings differ in their channels, nothing touches, places are not known, or a channel
            never changes.
        MissingInputError: no recording has touches in two blocks of places, or they lie in patches too far
            apart for distances along the skin.
    """
    weighed = [log for log in logs if log.force is not None and np.isfinite(log.force).any()]
    if parameters.force is None:
        weighed = []
    pressed = [log for log in logs if not any(log is other for other in weighed)]
    runs, recordings = gathered(pressed, parameters) if pressed else ([], pd.DataFrame())
    parts: dict[str, list[pd.DataFrame]] = {"recordings": [recordings]}

    def collect(names: Sequence[str], function: Callable[..., Any], work: Sequence[Any], about: str) -> None:
        """Add what a function returns for each piece of work: a table for each name."""
        for result in parallel_map(function, work, about, local=True):
            for name, table in zip(names, result, strict=True):
                parts.setdefault(name, []).append(table)

    with threadpool_limits(1):  # as in separate processes, so that their number changes no bit
        learned = parallel_map(_whole, runs, "skins", local=True)
        skins = {run.name: skin for run, skin in zip(runs, learned, strict=True)}
        if runs:
            collect(("errors", "map"), place_errors, folds_of(runs), "maps of a skin")
        across = [(skins[run.name], run, other) for run in runs for other in runs if other is not run]
        collect(("errors", "maps"), place_errors, across, "other runs")
        if parameters.servo is not None:
            collect(("servo", "paths"), servo_trials, across, "servoing")
        if parameters.published is not None:
            compared = within_runs(logs, parameters.published)
            parts |= {name: [table] for name, table in zip(("published", "rivals"), compared, strict=True)}
        if parameters.force is not None:
            one_skin = [log for log in weighed if log.channels == logs[0].channels]
            forces = force_errors(one_skin, parameters.force, parameters.rival_samples)
            parts |= {name: [table] for name, table in zip(("force", "lags", "traces"), forces, strict=True)}
    there = {name: [table for table in frames if len(table)] for name, frames in parts.items()}
    tables = {name: pd.concat(frames, ignore_index=True) for name, frames in there.items() if frames}
    return skins, tables


def _whole(run: Touches) -> TrainedTouch:
    return learn_skin(run, np.full(len(run.counts), True), run.parameters.servo is not None)


def servo_trials(work: tuple[TrainedTouch, Touches, Touches]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Servoing trials of all controllers, from press to press of another run.

    Returns:
        Trials: `learned_from`, `test_run`, `model`, `controller`, `seed`, `trial`, `arrived`, `left_mm`,
        `length_ratio`, `straight_mm`. Paths of the adaptive controller of the first seed with structure:
        `learned_from`, `test_run`, `trial`, `step`, `x_m`, `y_m`, `target_x_m`, `target_y_m`.
    """
    learned, run, other = work
    chosen = run.parameters.servo
    assert chosen is not None
    table, rng = table_of(run, other, 1e-3 * chosen.depth_mm), np.random.default_rng(chosen.seed)
    starts, targets = rng.integers(0, len(table.pressure), (2, chosen.trials))
    straight = np.linalg.norm(table.place[starts, :PLANE] - table.place[targets, :PLANE], axis=1)
    names, trials, paths = {"learned_from": run.name, "test_run": other.name}, [], pd.DataFrame()
    for structure, controller, servo in controllers(learned, run.parameters):
        map_alone = structure and len(learned.units.action_scale) == PLANE
        done = servo_on_table(servo, table, starts, targets, chosen.steps, map_alone)
        arrival = done.arrival(1e-3 * chosen.tolerance_mm)
        seed, trial = np.indices(arrival.shape).reshape(2, -1)
        columns = names | {
            "model": STRUCTURED if structure else PLAIN,
            "controller": controller,
            "seed": seed,
            "trial": trial,
            "arrived": (arrival >= 0).ravel(),
            "left_mm": 1e3 * done.left()[-1].ravel(),
            "length_ratio": done.length_ratio(arrival).ravel(),
            "straight_mm": 1e3 * straight[trial],
        }
        trials.append(pd.DataFrame(columns))
        if structure and controller == ADAPTIVE:
            steps = len(done.path)
            places = np.hstack([done.path[:, 0].reshape(-1, PLANE), np.tile(done.target, (steps, 1))])
            paths = pd.DataFrame(places, columns=["x_m", "y_m", "target_x_m", "target_y_m"])
            step, trial = np.indices((steps, chosen.trials)).reshape(2, -1)
            paths = paths.assign(trial=trial, step=step, **names)
    return pd.concat(trials, ignore_index=True), paths


def table_of(run: Touches, other: Touches, depth_m: float) -> PressedSkin:
    """Presses of another run; if all training touches have one depth, only those within `depth_m` of it."""
    kept = np.full(len(other.counts), True)
    if np.std(run.place[:, PLANE]) < NEVER_VARIES:
        away = np.abs(other.place[:, PLANE] - run.place[:, PLANE].mean())
        kept = away <= max(depth_m, away.min())
    return other.skin(np.flatnonzero(kept))


def controllers(
    learned: TrainedTouch, parameters: TouchParameters
) -> Iterator[tuple[bool, str, TactileServo]]:
    """Controllers to compare: whether the latent space is structured, name and controller."""
    chosen = parameters.servo
    assert chosen is not None
    compared: list[tuple[str, InverseModel]] = [
        *((inverse, inverse) for inverse in PUBLISHED_SERVO),
        (ADAPTIVE, "NJ"),
    ]
    trust = ModelTrust(by_likelihood=True, spread=SPREAD, correction=chosen.correction)
    for structure in STRUCTURES:
        for name, inverse in compared:
            settings = ServoParameters(
                inverse=inverse,
                action_penalty=parameters.spaces.training.action_penalty,
                gradient_gain=chosen.gradient_gain,
                largest_action=chosen.largest_action,
            )
            given = learned.models, learned.units, structure, settings, 1.0 / STEP_S
            if name == ADAPTIVE:
                yield structure, name, AdaptiveServo(*given, actions_per_step=1, trust=trust)
            else:
                yield structure, name, TactileServo(*given)
