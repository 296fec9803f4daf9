"""Servoing in a recorded map: learned from one run, tried on the table of presses of another one (II.3.5)."""

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from structlearn.tactile.latent_parameters import STRUCTURES, InverseModel
from structlearn.tactile.pressed_skin import PLANE, STEP_S, PressedSkin, servo_on_table
from structlearn.tactile.servo_controller import Caution, RestingServo, ServoParameters, TactileServo
from structlearn.tasks.touch.skin_readings import joined
from structlearn.tasks.touch.skin_touches import NEVER_VARIES, LearnedSkin, Touches
from structlearn.tasks.touch.touch_names import CORRECTED, PLAIN, STRUCTURED, TEXT_SERVO
from structlearn.tasks.touch.touch_parameters import TouchParameters

SPREAD = 0.5
"""Of likely actions, over which the corrected controller takes slopes."""


def servo_trials(
    work: tuple[LearnedSkin, Touches, Sequence[Touches]], parameters: TouchParameters
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Closed loops of all controllers, from press to press of other runs.

    Returns:
        Trials: `learned_from`, `asked_about`, `model`, `controller`, `seed`, `trial`, `arrived`, `left_mm`,
        `length_ratio`, `straight_mm`. Paths of the corrected controller of the first seed with structure:
        `learned_from`, `asked_about`, `trial`, `step`, `x_m`, `y_m`, `target_x_m`, `target_y_m`.
    """
    (learned, run, others), chosen = work, parameters.servo
    assert chosen is not None
    trials, paths = [], []
    for other in others:
        table, rng = table_of(run, other, parameters), np.random.default_rng(chosen.seed)
        starts, targets = rng.integers(0, len(table.pressure), (2, chosen.trials))
        straight = np.linalg.norm(table.place[starts, :PLANE] - table.place[targets, :PLANE], axis=1)
        names = {"learned_from": run.name, "asked_about": other.name}
        for structure, controller, servo in controllers(learned, parameters):
            map_alone = structure and len(learned.units.action_scale) == PLANE
            done = servo_on_table(servo, table, starts, targets, chosen.steps, map_alone)
            arrival = done.arrival(1e-3 * chosen.tolerance_mm)
            seed, trial = np.indices(arrival.shape).reshape(2, -1)
            model = {"model": STRUCTURED if structure else PLAIN, "controller": controller}
            columns = {
                "seed": seed,
                "trial": trial,
                "arrived": (arrival >= 0).ravel(),
                "left_mm": 1e3 * done.left()[-1].ravel(),
                "length_ratio": done.length_ratio(arrival).ravel(),
                "straight_mm": 1e3 * straight[trial],
            }
            trials.append(pd.DataFrame(names | model | columns))
            if structure and controller == CORRECTED:
                steps, count = done.path.shape[0], chosen.trials
                places = np.hstack([done.path[:, 0].reshape(-1, PLANE), np.tile(done.target, (steps, 1))])
                way = pd.DataFrame(places, columns=["x_m", "y_m", "target_x_m", "target_y_m"])
                step, trial = np.indices((steps, count)).reshape(2, -1)
                paths.append(way.assign(trial=trial, step=step, **names))
    return joined(trials), joined(paths)


def table_of(run: Touches, other: Touches, parameters: TouchParameters) -> PressedSkin:
    """Presses of another run; of those that the learned run knows the depth of, where it knows one only."""
    assert parameters.servo is not None
    kept = np.full(len(other.counts), True)
    if np.std(run.place[:, PLANE]) < NEVER_VARIES:
        away = np.abs(other.place[:, PLANE] - run.place[:, PLANE].mean())
        kept = away <= max(1e-3 * parameters.servo.depth_mm, away.min())
    return other.skin(np.flatnonzero(kept))


def controllers(
    learned: LearnedSkin, parameters: TouchParameters
) -> Iterator[tuple[bool, str, TactileServo]]:
    """Structure, name and controller of all that are compared."""
    assert parameters.servo is not None
    compared: list[tuple[str, InverseModel]] = [*((one, one) for one in TEXT_SERVO), (CORRECTED, "NJ")]
    chosen, beta = parameters.servo, parameters.spaces.training.action_penalty
    for structure in STRUCTURES:
        for name, inverse in compared:
            settings = ServoParameters(
                inverse=inverse,
                trained_with_inverse=True,
                action_penalty=beta,
                gradient_gain=chosen.gradient_gain,
                largest_action=chosen.largest_action,
                horizon=1,
            )
            given = learned.models, learned.units, structure, settings, 1.0 / STEP_S
            if name == CORRECTED:
                caution = Caution(by_likelihood=True, spread=SPREAD, correction=chosen.correction)
                yield structure, name, RestingServo(*given, actions_per_step=1, caution=caution)
            else:
                yield structure, name, TactileServo(*given)
