"""Which executions the recordings show: one of each kind in every setting, from the files of the stages."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.ground.artefacts import read_table
from structlearn.recordings import read_demonstrations
from structlearn.recordings.demonstration import Demonstration
from structlearn.recordings.source import ClockParameters
from structlearn.testbeds.scraping.protocol.executed_sets import AFTER, BEFORE, NOMINAL
from structlearn.testbeds.scraping.protocol.orientation_cost import nominal_orientation, orientation_cost
from structlearn.testbeds.scraping.recordings.shown_execution import Execution, execution

CORRECTED, FEEDBACK = "corrected", "feedback"

UNREFINED, REFINED = "before refinement", "after refinement"
"""Labels of the executions with feedback."""

NEEDED = ("orientation", "joint_positions", "wrench", "tool_to_board", "true_segments")
"""Of a run; your own corrections need not have them all, and are not shown then."""


def read_shown_runs(
    raw: Path, feedback: Path, model: str, primitives: Sequence[str], clock: ClockParameters
) -> dict[float, list[Execution]]:
    """The first nominal, corrected and closed-loop run of every setting that has all three.

    Args:
        raw: folder with `closed_loop` and `corrections`.
        feedback: folder with `dataset` and `evaluation`.
        model: whose closed loop is shown.
        primitives: names in order of time.
        clock: on which the runs are read.

    Returns:
        By roll of the board in degrees, the largest first; empty where nothing was executed.

    Raises:
        InputError: a file is not readable.
    """
    evaluation = feedback / "evaluation" / "traces.parquet"
    if not evaluation.exists():
        return {}
    folders = {NOMINAL: f"closed_loop/{NOMINAL}", CORRECTED: "corrections", model: f"closed_loop/{model}"}
    labels = {NOMINAL: NOMINAL, CORRECTED: CORRECTED, model: FEEDBACK}
    executed = _first_runs(read_table(evaluation))
    corrected = _corrections(feedback / "dataset", executed["primitive"].unique())
    found = _first_files({kind: raw / folder for kind, folder in folders.items()}, executed, clock)
    return _executions(found, labels, primitives, pd.concat([executed, corrected]))


def read_refined_runs(
    raw: Path, feedback: Path, primitives: Sequence[str], clock: ClockParameters
) -> dict[float, list[Execution]]:
    """The first run without feedback, before and after refinement by trial of every setting, with its cost.

    Args:
        raw: folder with `refined` and `unrolls`.
        feedback: folder with `refined`.
        primitives: names in order of time.
        clock: on which the runs are read and judged.

    Returns:
        By roll of the board in degrees, the largest first; empty where nothing was refined.

    Raises:
        InputError: a file is not readable.
    """
    evaluation = feedback / "refined" / "traces.parquet"
    if not evaluation.exists():
        return {}
    labels = {NOMINAL: "without feedback", BEFORE: UNREFINED, AFTER: REFINED}
    executed = _first_runs(read_table(evaluation))
    found = _first_files({kind: raw / "refined" / kind for kind in labels}, executed, clock)
    nominal = nominal_orientation(read_demonstrations(raw / "unrolls", **clock.model_dump()))
    return _executions(found, labels, primitives, executed, nominal)


def _first_runs(traces: pd.DataFrame) -> pd.DataFrame:
    return traces[traces["run"] == traces["run"].min()]


def _corrections(datasets: Path, primitives: Sequence[str]) -> pd.DataFrame:
    """The first corrections as traces, with their targets."""
    tables = []
    for name in primitives:
        dataset = read_table(datasets / f"{name}.parquet").rename(columns={"target": "coupling"})
        tables.append(dataset[dataset["demonstration"] == 0].assign(primitive=name, model=CORRECTED))
    return pd.concat(tables)


def _first_files(
    folders: Mapping[str, Path], traces: pd.DataFrame, clock: ClockParameters
) -> dict[float, dict[str, Demonstration]]:
    """The first run of each kind, of the settings that have complete ones of all kinds."""
    found = {}
    for setting in sorted(traces["setting_deg"].unique(), reverse=True):
        runs = {
            kind: read_demonstrations(file, **clock.model_dump())[0]
            for kind, folder in folders.items()
            for file in sorted((folder / f"{setting:g}").glob("*.mcap"))[:1]
        }
        if len(runs) == len(folders) and all(_complete(run) for run in runs.values()):
            found[float(setting)] = runs
    return found


def _complete(run: Demonstration) -> bool:
    return all(getattr(run, name) is not None for name in NEEDED)


def _executions(
    found: Mapping[float, Mapping[str, Demonstration]],
    labels: Mapping[str, str],
    primitives: Sequence[str],
    traces: pd.DataFrame,
    nominal: np.ndarray | None = None,
) -> dict[float, list[Execution]]:
    """The runs with their traces, and with their cost where the nominal orientation is known."""
    shown = {}
    for setting, runs in found.items():
        of_setting = traces[traces["setting_deg"] == setting]
        felt = {kind: dict(iter(own.groupby("primitive"))) for kind, own in of_setting.groupby("model")}
        shown[setting] = [
            execution(
                labels[kind],
                run,
                setting,
                primitives,
                felt[kind],
                None if nominal is None else orientation_cost(run, nominal),
            )
            for kind, run in runs.items()
        ]
    return shown
