"""Which executions the recordings show: one of each kind in every setting, from the files of the stages."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from structlearn.artefacts import read_table
from structlearn.feedback.closed_loop import NOMINAL
from structlearn.recordings import read_demonstrations
from structlearn.recordings.demonstration import Demonstration
from structlearn.recordings.source import ClockParameters
from structlearn.viewer.run import Execution, execution

CORRECTED, FEEDBACK = "corrected", "feedback"

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
    traces = _traces(evaluation, feedback / "dataset")
    folders = {NOMINAL: f"closed_loop/{NOMINAL}", CORRECTED: "corrections", model: f"closed_loop/{model}"}
    labels = {NOMINAL: NOMINAL, CORRECTED: CORRECTED, model: FEEDBACK}
    shown = {}
    for setting in sorted(traces["setting_deg"].unique(), reverse=True):
        of_setting = traces[traces["setting_deg"] == setting]
        runs = {
            kind: read_demonstrations(file, **clock.model_dump())[0]
            for kind, folder in folders.items()
            for file in sorted((raw / folder / f"{setting:g}").glob("*.mcap"))[:1]
        }
        if len(runs) == len(folders) and all(_complete(run) for run in runs.values()):
            felt = {kind: dict(iter(own.groupby("primitive"))) for kind, own in of_setting.groupby("model")}
            shown[float(setting)] = [
                execution(labels[kind], run, float(setting), primitives, felt[kind])
                for kind, run in runs.items()
            ]
    return shown


def _complete(run: Demonstration) -> bool:
    return all(getattr(run, name) is not None for name in NEEDED)


def _traces(evaluation: Path, datasets: Path) -> pd.DataFrame:
    """Traces of the first runs, with or without feedback, and of the first corrections with their targets."""
    executed = read_table(evaluation)
    tables = [executed[executed["run"] == executed["run"].min()]]
    for name in executed["primitive"].unique():
        dataset = read_table(datasets / f"{name}.parquet").rename(columns={"target": "coupling"})
        tables.append(dataset[dataset["demonstration"] == 0].assign(primitive=name, model=CORRECTED))
    return pd.concat(tables)
