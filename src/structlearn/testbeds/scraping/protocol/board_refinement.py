"""Refinement of the feedback models on a tilt of the simulated board, primitive after primitive (IV.9.4)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.feedback.coupling_dataset import CouplingDataset, concatenated
from structlearn.feedback.coupling_model import CouplingModel, NetworkParameters, train_final
from structlearn.policy_search.refinement import (
    FEEDBACK,
    Progress,
    RefinementParameters,
    executed,
    open_loop_weights,
    refine,
)
from structlearn.primitives.kernels import KERNEL_COUNT
from structlearn.testbeds.scraping.protocol.board_rollouts import Board


class BoardRefinementParameters(RefinementParameters, NetworkParameters):
    """Refinement on the board."""

    settings_deg: tuple[float, ...] = Field(min_length=1)
    setting_deg: float
    exploration: dict[str, Annotated[float, Field(gt=0)]] = Field(min_length=1)
    shown_runs: int = Field(ge=0)
    level_runs: int = Field(ge=0)
    seed: int = Field(ge=0)


@dataclass(frozen=True)
class Refined:
    """Feedback models before and after, and every rollout in between; tables have a column `primitive`."""

    before: Mapping[str, CouplingModel]  # networks by primitive, learned from demonstrations alone
    after: Mapping[str, CouplingModel]  # networks by primitive
    history: pd.DataFrame  # of `refinement.history_rows`
    samples: pd.DataFrame  # of `refinement.sample_rows`
    policies: pd.DataFrame  # `iteration`, `kind`, `number` and `weight_00`, ... of the open-loop rollouts.


def refine_on_board(
    board: Board,
    datasets: Mapping[str, CouplingDataset],
    parameters: BoardRefinementParameters,
    report: Callable[[str, Progress], None] = lambda name, progress: None,
) -> Refined:
    """Learn the models from demonstrations, then refine them in order of time.

    While a primitive is refined, those before it run with their refined models.

    `board`: tilted as it is refined on; its name and preceding networks are replaced. `datasets`:
    demonstrations of the settings to learn from, by primitive. `report`: called with the primitive's name
    after every iteration. Raises InputError: a primitive to be refined has no demonstrations, or too many
    rollouts fail.
    """
    unknown = sorted(set(parameters.exploration) - set(datasets))
    if unknown:
        raise InputError(f"refine.exploration names {', '.join(unknown)}: no primitive with corrections")
    names = [primitive.name for primitive in board.primitives if primitive.name in datasets]
    work = [(datasets[name], parameters) for name in names]
    before = dict(zip(names, parallel_map(_learned, work, "models before refinement"), strict=True))
    after, states = dict(before), {}
    for place, name in enumerate(names):
        if name in parameters.exploration:
            own = replace(board, name=name, preceding={one: after[one] for one in names[:place]})
            states[name] = refine(
                own,
                before[name],
                _with_executions(own, datasets[name], parameters),
                parameters,
                parameters.exploration[name],
                parameters.seed,
                report=partial(report, name),
            )
            after[name] = states[name].network
    tables = {
        "history": {name: state.history for name, state in states.items()},
        "samples": {name: state.samples for name, state in states.items()},
        "policies": {name: _policies(state) for name, state in states.items()},
    }
    return Refined(before, after, **{name: _joined(parts) for name, parts in tables.items()})


def _learned(work: tuple[CouplingDataset, BoardRefinementParameters]) -> CouplingModel:
    dataset, parameters = work
    return train_final(parameters.model, dataset, parameters.training, parameters.hidden)


def _with_executions(
    board: Board, demonstrations: CouplingDataset, parameters: BoardRefinementParameters
) -> CouplingDataset:
    """Demonstrations, executions of their mean in every setting, and executions on the level board."""
    known = [
        (float(setting), open_loop_weights(demonstrations.where(demonstrations.setting == setting)))
        for setting in np.unique(demonstrations.setting)
    ]
    work = [(parameters.shown_runs, *one) for one in known]
    work.append((parameters.level_runs, 0.0, np.zeros(KERNEL_COUNT)))
    parts = [
        executed(replace(board, setting_deg=setting), policy, runs) for runs, setting, policy in work if runs
    ]
    return concatenated([demonstrations, *parts])


def _policies(state: Progress) -> pd.DataFrame:
    rows = state.history.loc[state.history["kind"] != FEEDBACK, ["iteration", "kind", "number"]]
    weights = {f"weight_{index:02d}": values for index, values in enumerate(state.policies.T)}
    return rows.assign(**weights)


def _joined(parts: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    tables = [table.assign(primitive=name) for name, table in parts.items()]
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()
