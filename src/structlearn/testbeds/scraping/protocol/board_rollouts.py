"""Rollouts of one primitive on the simulated board, for the refinement of its feedback model."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.feedback.coupling_model import CouplingModel
from structlearn.feedback.coupling_targets import SupervisionParameters, corrected_primitive, coupling_samples
from structlearn.feedback.skill import Limits, ReactiveSkill, largest_coupling, on_axis
from structlearn.policy_search.refinement import Rollout
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.vector import VectorPrimitive
from structlearn.readers.clock import synchronise
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.recording import Recording
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


Work = tuple[Board, CouplingModel, tuple[int, ...]]


def _rollout(work: Work) -> Rollout:
    board, network, seed = work
    try:
        return _judged(board, network, seed)
    except FAILURES as error:
        return _failed(f"{type(error).__name__}: {error}")


def _lost(work: Work) -> Rollout:
    return _failed("the process died")


def _failed(fault: str) -> Rollout:
    return Rollout(np.array([np.nan]), None, fault)


def _judged(board: Board, network: CouplingModel, seed: tuple[int, ...]) -> Rollout:
    """One execution with its cost per tick and what it says as supervised data.

    Raises InputError: the run has diverged: a signal is not finite, or the tool is off by `DIVERGED_RAD`.
    """
    recording = board.execution(network, seed)
    demonstration = synchronise(recording, board.clock.rate_hz, board.clock.max_gap_s)
    cost = orientation_cost(demonstration, board.nominal)
    if cost.max() > DIVERGED_RAD:
        raise InputError(f"the tool is off by {np.degrees(cost.max()):.0f} degrees: the run has diverged")
    start_s, end_s = demonstration.signal("true_segments")[board.place]
    first, last = round(start_s / demonstration.dt), round(end_s / demonstration.dt)
    return Rollout(cost[first : last + 1], _samples(board, demonstration) if board.telling else None)


def _samples(board: Board, demonstration: Demonstration) -> CouplingDataset:
    """What was felt and done, as supervised data."""
    own = board.supervision
    cut = pd.Series(demonstration.signal("true_segments")[board.place], ["start_s", "end_s"])
    primitive, expected = board.primitives[board.place], board.expected[board.name]
    done = corrected_primitive(demonstration, cut, primitive, expected, own)
    return coupling_samples(done, board.setting_deg, 0, own)[own.axis]


def read_board(
    data: str | Path,
    settings_deg: Sequence[float],
    setting_deg: float,
    supervision: SupervisionParameters,
    testbed: TestbedParameters,
    clock: ClockParameters,
) -> tuple[Board, dict[str, CouplingDataset]]:
    """The board of the first primitive with feedback, and the demonstrations.

    `settings_deg`: rolls that demonstrations are read of; their coupling terms bound those of the feedback.
    Returns the board and the demonstrations by primitive. Raises InputError: a file is missing or not
    readable, or a setting was not recorded.
    """
    files = ScrapingFiles(Path(data))
    datasets = files.datasets(settings_deg)
    largest = largest_coupling([one.target for one in datasets.values()])
    board = Board(
        primitives=files.primitives(),
        expected=files.expected(),
        preceding={},
        name=supervision.primitives[0],
        setting_deg=setting_deg,
        nominal=nominal_orientation(files.runs("unrolls")),
        supervision=supervision,
        testbed=testbed,
        limits=Limits(largest_coupling={supervision.axis: largest}),
        clock=clock,
    )
    return board, datasets
