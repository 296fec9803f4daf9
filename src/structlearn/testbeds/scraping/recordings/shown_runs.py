"""Which executions the recordings show: the first of each kind in every setting."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from structlearn.feedback.coupling_dataset import to_table
from structlearn.feedback.training_parameters import POINTWISE
from structlearn.testbeds.scraping.files import CLOSED_LOOP, CORRECTIONS, REFINED, ScrapingFiles
from structlearn.testbeds.scraping.names import CORRECTED, RUNS
from structlearn.testbeds.scraping.protocol.executed_sets import AFTER, BEFORE, NOMINAL
from structlearn.testbeds.scraping.protocol.orientation_cost import nominal_orientation, orientation_cost
from structlearn.testbeds.scraping.recordings.shown_execution import Execution

NEEDED = ("orientation", "joint_positions", "wrench", "tool_to_board", "true_segments")
"""Of a run that is shown."""

FEEDBACK_RUNS = {
    NOMINAL: (CLOSED_LOOP, NOMINAL),
    CORRECTED: (CORRECTIONS, ""),
    POINTWISE: (CLOSED_LOOP, POINTWISE),  # trained as in the dissertation
}
REFINED_RUNS = {model: (REFINED, model) for model in (NOMINAL, BEFORE, AFTER)}
"""Where the runs lie that a recording puts beside each other, for `ScrapingFiles.runs_at`."""


def read_feedback_runs(files: ScrapingFiles) -> dict[float, list[Execution]]:
    """The first nominal, corrected and closed-loop run of every setting that has all three.

    Returns by roll of the board in degrees, the largest first; empty where nothing was executed. Raises
    InputError: a file is not readable.
    """
    traces = files.table("traces")
    if traces.empty:
        return {}
    corrected = [to_table(dataset).assign(primitive=name) for name, dataset in files.datasets().items()]
    targets = pd.concat(corrected).query("demonstration == 0").rename(columns={"target": "coupling"})
    return _read(files, FEEDBACK_RUNS, pd.concat([_first_runs(traces), targets.assign(model=CORRECTED)]))


def read_refined_runs(files: ScrapingFiles) -> dict[float, list[Execution]]:
    """The first run without feedback, before and after refinement by trial of every setting, with its cost.

    Returns, raises:
        As `read_feedback_runs`.
    """
    traces = files.table("refined_traces")
    if traces.empty:
        return {}
    return _read(files, REFINED_RUNS, _first_runs(traces), nominal_orientation(files.runs("unrolls")))


def _first_runs(traces: pd.DataFrame) -> pd.DataFrame:
    return traces[traces["run"] == traces["run"].min()]


def _read(
    files: ScrapingFiles,
    places: Mapping[str, tuple[str, str]],
    traces: pd.DataFrame,
    nominal: np.ndarray | None = None,
) -> dict[float, list[Execution]]:
    """Executions of the settings that have a complete run of every kind, with cost if nominal is known."""
    primitives = [primitive.name for primitive in files.primitives()]
    shown = {}
    for setting in sorted(traces["setting_deg"].unique(), reverse=True):
        found = {
            kind: run
            for kind, (folder, model) in places.items()
            for run in files.runs_at(setting, folder, model)[:1]
            if all(getattr(run, name) is not None for name in NEEDED)
        }
        if len(found) == len(places):
            felt = dict(iter(traces[traces["setting_deg"] == setting].groupby("model")))
            shown[float(setting)] = [
                Execution(
                    RUNS[kind],
                    run,
                    float(setting),
                    primitives,
                    felt[kind],
                    None if nominal is None else orientation_cost(run, nominal),
                )
                for kind, run in found.items()
            ]
    return shown
