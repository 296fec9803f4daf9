"""What is executed to judge feedback models, and the tables that come of it (IV.9.3.5)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.feedback.coupling_model import CouplingModel
from structlearn.feedback.supervision import Cuts, SupervisionParameters
from structlearn.ground.params import Parameters
from structlearn.primitives.vector import VectorPrimitive
from structlearn.recordings.demonstration import Demonstration
from structlearn.testbeds.scraping.protocol.execution_scores import execution_scores, feedback_traces

NOMINAL = "nominal"
"""Name of the executions without feedback."""

BEFORE, AFTER = "before", "after"
"""Names of the executions with feedback before and after refinement by trial."""


class EvaluationParameters(Parameters):
    """Executions for the evaluation."""

    settings_deg: tuple[float, ...] = Field(min_length=1)
    runs: int = Field(ge=1)


@dataclass(frozen=True)
class ExecutedSet:
    """Executions with one model, or without."""

    model: str  # its name, or `NOMINAL`
    networks: Mapping[str, CouplingModel]  # its networks by primitive; none without feedback
    runs: Mapping[float, Sequence[Demonstration]]  # by setting in degrees
    cuts: Mapping[float, Cuts]  # of these runs by setting


def scores(
    sets: Sequence[ExecutedSet], nominal_orientation: np.ndarray, parameters: SupervisionParameters
) -> pd.DataFrame:
    """Rows of `execution_scores` with `model` and `setting_deg`, of the primitives with feedback.

    `nominal_orientation`: (T, 4) of `cost.nominal_orientation`.
    """
    tables = []
    for executed in sets:
        for setting, runs in executed.runs.items():
            cuts = {name: executed.cuts[setting][name] for name in parameters.primitives}
            table = execution_scores(runs, cuts, nominal_orientation, parameters.unit_axis)
            tables.append(table.assign(model=executed.model, setting_deg=setting))
    return pd.concat(tables, ignore_index=True)


def traces(
    sets: Sequence[ExecutedSet], expected: Mapping[str, VectorPrimitive], parameters: SupervisionParameters
) -> pd.DataFrame:
    """Rows of `feedback_traces` with `model` and `primitive`, for every set and primitive with feedback."""
    tables = []
    for executed in sets:
        for name in parameters.primitives:
            cuts = {setting: own[name] for setting, own in executed.cuts.items()}
            table = feedback_traces(
                executed.runs, cuts, expected[name], executed.networks.get(name), parameters
            )
            tables.append(table.assign(model=executed.model, primitive=name))
    return pd.concat(tables, ignore_index=True)
