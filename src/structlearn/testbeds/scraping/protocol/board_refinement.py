"""Refinement of the feedback models on a tilt of the simulated board, primitive after primitive (IV.9.4)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.feedback.coupling_dataset import CouplingDataset, concatenated
from structlearn.feedback.coupling_model import CouplingModel, NetworkParameters, train_final
from structlearn.feedback.coupling_targets import SupervisionParameters, corrected_primitive, coupling_samples
from structlearn.feedback.skill import Limits, ReactiveSkill, largest_coupling, on_axis
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
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.vector import VectorPrimitive
from structlearn.readers.clock import synchronise
from structlearn.readers.demonstration import Recording
from structlearn.readers.source import ClockParameters
from structlearn.testbeds.scraping.files import ScrapingFiles
from structlearn.testbeds.scraping.protocol.execution_scores import nominal_orientation, orientation_cost
from structlearn.testbeds.scraping.protocol.executions import Run, execute_run
from structlearn.testbeds.scraping.world.testbed import TestbedParameters

REFINED = 4  # First number of a rollout's seed: what the run is for
FAILURES = (InputError, ValueError, FloatingPointError, ArithmeticError, np.linalg.LinAlgError)
"""What a run that diverges may raise; errors of the program itself are not hidden."""

DIVERGED_RAD = np.pi / 2
"""A tool that is off by a right angle is no longer used as one. The simulator bounds what a diverging robot
does, so it flails with finite signals; its cost beside the others' would make them all look alike."""


class BoardRefinementParameters(RefinementParameters, NetworkParameters):
    """Refinement on the board."""

    settings_deg: tuple[float, ...] = Field(min_length=1)
    setting_deg: float
    exploration: dict[str, Annotated[float, Field(gt=0)]] = Field(min_length=1)
    shown_runs: int = Field(ge=0)
    level_runs: int = Field(ge=0)
    seed: int = Field(ge=0)


@dataclass(frozen=True)
class Board:
    """One primitive of the scraping task on a board of one tilt (`refinement.Environment`).

    The robot executes the primitives up to this one and stops; those before it run with their own networks.
    """

    primitives: Sequence[PosePrimitive]  # of the whole task
    expected: Mapping[str, VectorPrimitive]  # expected traces by the primitive's name
    preceding: Mapping[str, CouplingModel]  # networks of the primitives before this one
    name: str  # of the primitive that is refined
    setting_deg: float  # roll of the board
    nominal: np.ndarray  # (T, 4) of `nominal_orientation`
    supervision: SupervisionParameters  # how executions become supervised data
    testbed: TestbedParameters
    limits: Limits
    clock: ClockParameters  # on which executions are judged
    telling: bool = True  # whether rollouts say what was felt and done; a search needs costs alone

    @property
    def rate_hz(self) -> float:
        """Ticks per second of the costs."""
        return self.clock.rate_hz

    @property
    def place(self) -> int:
        """Of the primitive in the task."""
        return [primitive.name for primitive in self.primitives].index(self.name)

    def of(self, name: str, networks: Mapping[str, CouplingModel]) -> "Board":
        """The same for another primitive, before which the others run with these networks."""
        names = [primitive.name for primitive in self.primitives]
        before = {one: networks[one] for one in names[: names.index(name)] if one in networks}
        return replace(self, name=name, preceding=before)

    def rollouts(self, networks: Sequence[CouplingModel], seeds: Sequence[tuple[int, ...]]) -> list[Rollout]:
        """Execute once per network, in processes; a run that fails is reported in its rollout."""
        work = [(self, network, seed) for network, seed in zip(networks, seeds, strict=True)]
        return parallel_map(_rollout, work, f"rollouts of {self.name}", lost=_lost)

    def execution(self, network: CouplingModel, seed: tuple[int, ...]) -> Recording:
        """Execute the primitives up to this one, with a network for it."""
        executed = self.primitives[: self.place + 1]
        expected = {one.name: self.expected[one.name] for one in executed if one.name in self.expected}
        networks = on_axis({**self.preceding, self.name: network}, self.supervision.axis)
        skill = ReactiveSkill(executed, expected, networks, self.limits)
        run = Run("rollout", self.setting_deg, (REFINED, self.place, *seed), feedback=True)
        return execute_run(run, 0, skill, self.testbed)

    def judged(self, recording: Recording) -> Rollout:
        """Cost per tick of an execution, and what it says as supervised data.

        Raises InputError: it has diverged: a signal is not finite, or the tool is off by `DIVERGED_RAD`.
        """
        run, own = synchronise(recording, self.clock.rate_hz, self.clock.max_gap_s), self.supervision
        cost = orientation_cost(run, self.nominal)
        if cost.max() > DIVERGED_RAD:
            raise InputError(f"the tool is off by {np.degrees(cost.max()):.0f} degrees: the run has diverged")
        cut = pd.Series(run.signal("true_segments")[self.place], ["start_s", "end_s"])
        first, last = (round(end / run.dt) for end in cut)
        samples = None
        if self.telling:
            primitive, expected = self.primitives[self.place], self.expected[self.name]
            done = corrected_primitive(run, cut, primitive, expected, own)
            samples = coupling_samples(done, self.setting_deg, 0, own)[own.axis]
        return Rollout(cost[first : last + 1], samples)


Work = tuple[Board, CouplingModel, tuple[int, ...]]


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
) -> tuple[Board, dict[str, CouplingDataset]]:
    """The board that is refined on, of the first primitive with feedback, and demonstrations by primitive.

    Demonstrations are those of the settings that are learned from; their coupling terms bound those of the
    feedback. Raises InputError: a file is missing or not readable, or a setting was not recorded.
    """
    files = ScrapingFiles(Path(data))
    datasets = files.datasets(refined.settings_deg)
    largest = largest_coupling([one.target for one in datasets.values()])
    board = Board(
        primitives=files.primitives(),
        expected=files.expected(),
        preceding={},
        name=supervision.primitives[0],
        setting_deg=refined.setting_deg,
        nominal=nominal_orientation(files.runs("unrolls")),
        supervision=supervision,
        testbed=testbed,
        limits=Limits(largest_coupling={supervision.axis: largest}),
        clock=clock,
    )
    return board, datasets


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
    return Refined(
        before,
        after,
        history=_joined({name: state.history for name, state in states.items()}),
        samples=_joined({name: state.samples for name, state in states.items()}),
        policies=_joined({name: _policies(state) for name, state in states.items()}),
    )


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
