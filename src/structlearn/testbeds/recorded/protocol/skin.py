"""All that is asked of a recorded skin: is its map the skin, does it carry over, can one servo in it?"""

from collections.abc import Sequence

import pandas as pd

from structlearn.recordings.eflesh import ProbeRun
from structlearn.testbeds.recorded.protocol.skin_force import force_errors
from structlearn.testbeds.recorded.protocol.skin_map import (
    LearnedSkin,
    learn_runs,
    map_errors,
    other_run_errors,
)
from structlearn.testbeds.recorded.protocol.skin_parameters import SkinParameters
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
        InputError: a channel never changes, or a run on a scale has too few presses.
    """
    skins = learn_runs(presses, parameters)
    parts: dict[str, list[pd.DataFrame]] = {"errors": []}
    if presses:
        parts["errors"].append(map_errors(presses, parameters))
    for run, skin in zip(presses, skins, strict=True):
        others = [one for one in presses if one is not run]
        found = (
            *other_run_errors(skin, run, others, parameters),
            *servo_trials(skin, run, others, parameters),
        )
        for name, table in zip(("errors", "maps", "servo", "paths"), found, strict=True):
            parts.setdefault(name, []).append(table)
    if strokes:
        for name, table in zip(("force", "lags", "traces"), force_errors(strokes, parameters), strict=True):
            parts[name] = [table]
    tables = {name: [table for table in its if len(table)] for name, its in parts.items()}
    joined = {name: pd.concat(its, ignore_index=True) for name, its in tables.items() if its}
    return {run.name: skin for run, skin in zip(presses, skins, strict=True)}, joined
