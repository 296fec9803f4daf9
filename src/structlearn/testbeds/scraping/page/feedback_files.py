"""What the feedback stages left in their folders, read for the report."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from structlearn.feedback.feedback_models import POINTWISE
from structlearn.feedback.pmnn import read_networks
from structlearn.ground.artefacts import read_table
from structlearn.ground.params import Parameters
from structlearn.recordings import read_demonstrations
from structlearn.segmentation.execution_cuts import execution_cuts
from structlearn.testbeds.scraping.files import CHECKS, read_datasets, read_expected
from structlearn.testbeds.scraping.page.board_results import BoardResults
from structlearn.testbeds.scraping.page.feedback_results import FeedbackResults
from structlearn.testbeds.scraping.page.refinement_results import RefinementResults
from structlearn.testbeds.scraping.protocol.executed_sets import AFTER, BEFORE, NOMINAL


def read_feedback(
    raw: str | Path, feedback: str | Path, primitives: Sequence[str], parameters: Mapping[str, Parameters]
) -> FeedbackResults | None:
    """What the feedback stages wrote, as far as they had data.

    Args:
        raw: folder of the testbed's recordings.
        feedback: folder of what was learned from them.
        primitives: names in order.
        parameters: by key of `params.yaml`.

    Returns:
        The results; None where nothing was executed, as with nominal bags of your own alone.
    """
    raw, feedback = Path(raw), Path(feedback)
    expected = read_expected(feedback / "expected")
    if not expected:
        return None
    unrolls = read_demonstrations(raw / "unrolls", **parameters["clock"].model_dump())
    datasets = read_datasets(feedback / "dataset")
    return FeedbackResults(
        primitives=primitives,
        unrolls=unrolls,
        unroll_cuts=execution_cuts(unrolls, primitives, parameters["segment"]),
        expected=expected,
        datasets=datasets,
        checks={name: read_table(feedback / "dataset" / f"{CHECKS}{name}.parquet") for name in datasets},
        networks=read_networks(feedback / "models" / f"{POINTWISE}.safetensors") if datasets else {},
        comparison=_table(feedback / "comparison" / "scores.parquet"),
        orderings=_table(feedback / "comparison" / "orderings.parquet"),
        seen_deg=parameters["coupling_dataset"].settings_deg,
        board=_board(raw, feedback, parameters),
        refinement=read_refinement(raw, feedback, parameters),
    )


def read_refinement(
    raw: Path, feedback: Path, parameters: Mapping[str, Parameters]
) -> RefinementResults | None:
    """What the stages of the refinement wrote; for arguments see `read_feedback`.

    Returns:
        The results; None where the task is not the simulated one, or no primitive was refined.
    """
    history = _table(feedback / "refinement" / "history.parquet")
    scores = _table(feedback / "refined" / "scores.parquet")
    if history.empty or scores.empty:
        return None
    setting = parameters["refine"].setting_deg
    folders = {model: raw / "refined" / model / f"{setting:g}" for model in (NOMINAL, BEFORE, AFTER)}
    clock = parameters["clock"].model_dump()
    return RefinementResults(
        scores=scores,
        examples={
            model: read_demonstrations(folder, **clock)
            for model, folder in folders.items()
            if folder.exists()
        },
        example_deg=setting,
        axis=parameters["coupling_dataset"].unit_axis,
        history=history,
        search=_table(feedback / "search" / "trials.parquet"),
        parameters=parameters["refine"],
    )


def _board(raw: Path, feedback: Path, parameters: Mapping[str, Parameters]) -> BoardResults | None:
    """What was executed on the board; None where the task is not the simulated one."""
    scores = _table(feedback / "evaluation" / "scores.parquet")
    if scores.empty:
        return None
    largest = max(parameters["evaluate_feedback"].settings_deg)
    corrected = raw / "corrections" / f"{largest:g}"
    clock = parameters["clock"].model_dump()
    return BoardResults(
        scores=scores,
        traces=read_table(feedback / "evaluation" / "traces.parquet"),
        path_errors=read_table(feedback / "evaluation" / "path_errors.parquet"),
        examples={
            model: read_demonstrations(raw / "closed_loop" / model / f"{largest:g}", **clock)
            for model in (NOMINAL, POINTWISE)
        },
        corrected=read_demonstrations(corrected, **clock) if corrected.exists() else (),
        example_deg=largest,
        axis=parameters["coupling_dataset"].unit_axis,
        force_n=parameters["testbed"].control.force_n,
    )


def _table(path: Path) -> pd.DataFrame:
    return read_table(path) if path.exists() else pd.DataFrame()
