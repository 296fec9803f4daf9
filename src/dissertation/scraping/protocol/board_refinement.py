"""Refinement of the feedback models at one tilt of the simulated board, one primitive at a time (IV.9.4)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
from pydantic import Field

from dissertation.scraping.protocol.execution_scores import orientation_cost
from dissertation.scraping.protocol.executions import Bench, Run, execute_run, read_bench
from dissertation.scraping.world.testbed import TestbedParameters
from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.feedback.coupling_dataset import CouplingDataset, concatenated
from structlearn.feedback.coupling_model import CouplingModel
from structlearn.feedback.coupling_targets import SupervisionParameters, corrected_primitive, coupling_samples
from structlearn.feedback.skill import ReactiveSkill, on_axis
from structlearn.feedback.trainers import FeedbackNetworkParameters, train_final
from structlearn.policy_search.refinement import (
    FEEDBACK,
    Progress,
    RefinementParameters,
    Rollout,
    executed,
    open_loop_weights,
    refine,
)
from structlearn.primitives.kernels import KERNEL_COUNT
from structlearn.readers.clock import synchronise
from structlearn.readers.demonstration import Recording
from structlearn.readers.source import ClockParameters

REFINED = 4  # first number of a rollout's seed, its purpose
FAILURES = (ValueError, ArithmeticError, np.linalg.LinAlgError)  # InputError is a ValueError
"""Exceptions that a diverging run may raise; programming errors are not hidden."""

DIVERGED_RAD = np.pi / 2
"""Cost at which a run counts as diverged. The simulator bounds a diverging robot, so its signals stay finite,
but its cost would dwarf all differences among the others."""


class BoardRefinementParameters(RefinementParameters, FeedbackNetworkParameters):
    """Refinement on the board."""

    settings_deg: tuple[float, ...] = Field(min_length=1)
    setting_deg: float
    exploration: dict[str, Annotated[float, Field(gt=0)]] = Field(min_length=1)
    shown_runs: int = Field(ge=0)
    level_runs: int = Field(ge=0)
    seed: int = Field(ge=0)


Networks = Mapping[str, CouplingModel]
"""Feedback models by primitive."""


@dataclass(frozen=True)
class BoardEnvironment(Bench):
    """One primitive of the scraping task on a board at one tilt (`refinement.Environment`).

    The robot executes the primitives up to this one; the preceding ones run with their own networks.
    """

    preceding: Networks  # networks of the primitives before this one
    name: str  # primitive that is refined
    setting_deg: float  # roll of the board
    with_samples: bool = True  # whether rollouts include samples; a policy search only needs costs

    @property
    def rate_hz(self) -> float:
        """Sampling rate of the costs."""
        return self.clock.rate_hz

    def of(self, name: str, networks: Networks) -> "BoardEnvironment":
        """The board for another primitive, with these networks for the preceding ones."""
        before = [primitive.name for primitive in self.skill.primitives[: self.skill.index(name)]]
        return replace(self, name=name, preceding={one: networks[one] for one in before if one in networks})

    def rollouts(self, networks: Sequence[CouplingModel], seeds: Sequence[tuple[int, ...]]) -> list[Rollout]:
        """Execute once per network, in parallel; a failed run is reported in its rollout."""
        work = [(self, network, seed) for network, seed in zip(networks, seeds, strict=True)]
        return parallel_map(_rollout, work, f"rollouts of {self.name}", lost=_lost)

    def execution(self, network: CouplingModel, seed: tuple[int, ...]) -> Recording:
        """Execute the primitives up to this one, with `network` for this one."""
        place, whole = self.skill.index(self.name), self.skill
        executed = whole.primitives[: place + 1]
        expected = {one.name: whole.expected[one.name] for one in executed if one.name in whole.expected}
        networks = on_axis({**self.preceding, self.name: network}, self.supervision.axis)
        run = Run("rollout", self.setting_deg, (REFINED, place, *seed), feedback=True)
        return execute_run(run, 0, ReactiveSkill(executed, expected, networks, whole.limits), self.testbed)

    def judged(self, recording: Recording) -> Rollout:
        """Cost per tick of an execution, and its supervised data.

        Raises InputError: it has diverged, i.e. a signal is not finite or the tool is off by `DIVERGED_RAD`.
        """
        run, own = synchronise(recording, self.clock.rate_hz, self.clock.max_gap_s), self.supervision
        cost = orientation_cost(run, self.nominal)
        if cost.max() > DIVERGED_RAD:
            raise InputError(f"the tool is off by {np.degrees(cost.max()):.0f} degrees: the run has diverged")
        place = self.skill.index(self.name)
        cut = pd.Series(run.signal("true_segments")[place], ["start_s", "end_s"])
        first, last = (round(end / run.dt) for end in cut)
        samples = None
        if self.with_samples:
            primitive, expected = self.skill.primitives[place], self.skill.expected[self.name]
            done = corrected_primitive(run, cut, primitive, expected, own)
            samples = coupling_samples(done, self.setting_deg, 0, own)[own.axis]
        return Rollout(cost[first : last + 1], samples)


Work = tuple[BoardEnvironment, CouplingModel, tuple[int, ...]]


def _rollout(work: Work) -> Rollout:
    board, network, seed = work
    try:
        return board.judged(board.execution(network, seed))
    except FAILURES as error:
        return Rollout(np.array([np.nan]), None, f"{type(error).__name__}: {error}")


def _lost(work: Work) -> Rollout:
    return Rollout(np.array([np.nan]), None, "the process died")


def read_board(
    data: str | Path,
    refined: BoardRefinementParameters,
    supervision: SupervisionParameters,
    testbed: TestbedParameters,
    clock: ClockParameters,
) -> tuple[BoardEnvironment, dict[str, CouplingDataset]]:
    """Board to refine on, for the first primitive with feedback; see `read_bench`.

    Demonstrations are those of the training settings.
    """
    bench, datasets = read_bench(data, refined.settings_deg, supervision, testbed, clock)
    own, first = vars(bench), supervision.primitives[0]
    return BoardEnvironment(**own, preceding={}, name=first, setting_deg=refined.setting_deg), datasets


def refine_on_board(
    board: BoardEnvironment,
    datasets: Mapping[str, CouplingDataset],
    parameters: BoardRefinementParameters,
    report: Callable[[str, Progress], None] = lambda name, progress: None,
) -> tuple[Networks, Networks, dict[str, pd.DataFrame]]:
    """Learn the models from demonstrations, then refine them in temporal order.

    While a primitive is refined, the preceding ones run with their refined models. `board`: at the tilt to
    refine on; its name and preceding networks are replaced. `datasets`: demonstrations of the training
    settings by primitive. `report`: called with the primitive's name after every iteration.

    Returns networks by primitive before and after, and tables with a column `primitive`: `history` (of
    `refinement.history_rows`), `rollouts` (of `refinement.sample_rows`) and `policies` (weights of the
    open-loop rollouts).

    Raises InputError: a primitive to be refined has no demonstrations, or too many rollouts fail.
    """
    if unknown := sorted(set(parameters.exploration) - set(datasets)):
        raise InputError(f"refine.exploration names {', '.join(unknown)}: no primitive with corrections")
    names = [one.name for one in board.skill.primitives if one.name in datasets]
    work = [(datasets[name], parameters) for name in names]
    before = dict(zip(names, parallel_map(_learned, work, "models before refinement"), strict=True))
    after, states = dict(before), {}
    for name in names:
        if name in parameters.exploration:
            own = board.of(name, after)
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
        "rollouts": {name: state.samples for name, state in states.items()},
        "policies": {name: _policies(state) for name, state in states.items()},
    }
    return before, after, {name: _joined(parts) for name, parts in tables.items()}


def _learned(work: tuple[CouplingDataset, BoardRefinementParameters]) -> CouplingModel:
    dataset, parameters = work
    return train_final(parameters.network, dataset, parameters.training, parameters.hidden)


def _with_executions(
    board: BoardEnvironment, demonstrations: CouplingDataset, parameters: BoardRefinementParameters
) -> CouplingDataset:
    """Demonstrations, executions of their mean in each setting, and executions on the level board."""
    known = [
        (float(setting), open_loop_weights(demonstrations.where(demonstrations.setting == setting)))
        for setting in np.unique(demonstrations.setting)
    ]
    work = [(*one, parameters.shown_runs) for one in known]
    work.append((0.0, np.zeros(KERNEL_COUNT), parameters.level_runs))
    parts = [
        executed(replace(board, setting_deg=setting), policy, runs) for setting, policy, runs in work if runs
    ]
    return concatenated([demonstrations, *parts])


def _policies(state: Progress) -> pd.DataFrame:
    rows = state.history.loc[state.history["kind"] != FEEDBACK, ["iteration", "kind", "number"]]
    return rows.assign(**{f"weight_{index:02d}": values for index, values in enumerate(state.policies.T)})


def _joined(parts: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    tables = [table.assign(primitive=name) for name, table in parts.items()]
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()
