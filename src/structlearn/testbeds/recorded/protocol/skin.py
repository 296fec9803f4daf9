"""All that is asked of a recorded skin: is its map the skin, does it carry over, can one servo in it?"""

from collections.abc import Sequence
from functools import partial

import pandas as pd
from threadpoolctl import threadpool_limits

from structlearn.ground.parallel import parallel_map
from structlearn.recordings.eflesh import ProbeRun
from structlearn.testbeds.recorded.protocol.latent_touch_parameters import SkinParameters
from structlearn.testbeds.recorded.protocol.skin_force import force_errors
from structlearn.testbeds.recorded.protocol.skin_map import (
    LearnedSkin,
    learn_runs,
    map_errors,
    other_run_errors,
)
from structlearn.testbeds.recorded.protocol.skin_servoing import servo_trials


def learn_recorded_skin(
    presses: Sequence[ProbeRun], strokes: Sequence[ProbeRun], parameters: SkinParameters
) -> tuple[dict[str, LearnedSkin], dict[str, pd.DataFrame]]:
    """Learn from every run, and ask about what was left out of it and about all others.

    Args:
        presses: runs over places.
        strokes: runs on a scale.
        parameters: see there.

    Returns:
        Skins by the run that each was learned from. Tables by name, those alone that have rows: `errors`
        (`skin_map`), `maps`, `servo` and `paths` (`skin_servoing`), `force`, `lags` and `traces`
        (`skin_force`).

    Raises:
        InputError: a channel never changes.
        MissingInputError: no run has presses in two folds of blocks.
    """
    with threadpool_limits(1):  # as in processes of their own, so that their number changes no bit
        skins = dict(zip([run.name for run in presses], learn_runs(presses, parameters), strict=True))
        parts: dict[str, list[pd.DataFrame]] = {
            "errors": [map_errors(presses, parameters)] if presses else []
        }
        work = [(skins[run.name], run, [one for one in presses if one is not run]) for run in presses]
        for found in parallel_map(partial(_others, parameters=parameters), work, "other runs", local=True):
            for name, table in zip(("errors", "maps", "servo", "paths"), found, strict=True):
                parts.setdefault(name, []).append(table)
        for name, table in zip(("force", "lags", "traces"), force_errors(strokes, parameters), strict=True):
            parts[name] = [table]
    tables = {name: [table for table in its if len(table)] for name, its in parts.items()}
    return skins, {name: pd.concat(its, ignore_index=True) for name, its in tables.items() if its}


def _others(
    work: tuple[LearnedSkin, ProbeRun, list[ProbeRun]], parameters: SkinParameters
) -> tuple[pd.DataFrame, ...]:
    """What was learned from one run, on all others: errors, maps, servoing and its paths."""
    return *other_run_errors(*work, parameters), *servo_trials(*work, parameters)
