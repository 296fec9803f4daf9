"""Executions by the simulated robot: nominal, corrected by a person, or with feedback.

What varies between runs of a real set-up is drawn from each run's own seed, so any run can be repeated alone,
bit for bit, whatever the number of processes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from dissertation.scraping.files import ScrapingFiles, read_datasets, read_expected
from dissertation.scraping.protocol import execution_scores
from dissertation.scraping.protocol.execution_scores import ExecutionParameters
from dissertation.scraping.world.corrector import corrector
from dissertation.scraping.world.execution import Engine, execute
from dissertation.scraping.world.testbed import TestbedParameters, recorded_run, run_conditions
from dissertation.simulation.fingers import FingerPair
from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.feedback.coupling_model import CouplingModel
from structlearn.feedback.coupling_targets import SupervisionParameters
from structlearn.feedback.runtime import Controller
from structlearn.feedback.skill import Limits, ReactiveSkill, largest_coupling, on_axis
from structlearn.primitives.primitive_files import read_primitives
from structlearn.primitives.sequence import default_start
from structlearn.readers.clock import synchronise
from structlearn.readers.demonstration import Recording, write_runs
from structlearn.readers.source import ClockParameters

HOLD_S = 0.3  # s that the robot waits at the end, so that all streams cover the last sample


@dataclass(frozen=True)
class Run:
    """One planned execution."""

    name: str
    setting_deg: float  # roll of the board
    # random seed besides the testbed's; runs with equal seeds meet equal conditions
    seed: tuple[int, ...]
    corrected: bool = False  # whether a person corrects the roll while the robot is compliant
    feedback: bool = False  # whether the skill's networks are active


NOMINAL, CORRECTED, EVALUATED = 1, 2, 3  # first number of a run's seed, its purpose


def nominal_runs(count: int) -> list[Run]:
    """Executions in the default setting, for learning the expected traces."""
    return [Run(f"{number + 1:02d}", 0.0, (NOMINAL, 0, number)) for number in range(count)]


def runs_to_correct(settings_deg: Sequence[float], count: int) -> list[Run]:
    """Executions that a person corrects, `count` per setting, ordered by setting."""
    return _runs(CORRECTED, settings_deg, count, corrected=True)


def evaluation_runs(settings_deg: Sequence[float], count: int, feedback: bool) -> list[Run]:
    """Executions with or without feedback, ordered by setting; the n-th of both meet equal conditions."""
    return _runs(EVALUATED, settings_deg, count, feedback=feedback)


def _runs(purpose: int, settings_deg: Sequence[float], count: int, **how: bool) -> list[Run]:
    """Runs with seeds from the tilt in tenths of a degree, offset so that negative tilts differ."""
    return [
        Run(f"{number + 1:02d}", setting, (purpose, 10_000 + round(10 * setting), number), **how)
        for setting in settings_deg
        for number in range(count)
    ]


def executions(skill: ReactiveSkill, runs: Sequence[Run], testbed: TestbedParameters) -> list[Recording]:
    """Executions from the skill's mean start, in order; `true_segments` are the commanded primitives."""
    work = list(zip(runs, range(len(runs)), strict=True))
    return parallel_map(partial(_execute, skill=skill, testbed=testbed), work, "executions")


def execute_run(
    run: Run, index: int, skill: ReactiveSkill, testbed: TestbedParameters, engine: Engine | None = None
) -> Recording:
    """One execution, see `executions`; `index` sets the recorder's clock; for `engine` see `execute`."""
    sequence = np.random.SeedSequence([testbed.seed, *run.seed])
    conditions_rng, fingers_rng, wrist_rng, clocks_rng, person_rng = map(
        np.random.default_rng, sequence.spawn(5)
    )
    own, rate_hz = testbed.control, testbed.world.control_rate_hz
    controller = Controller(skill, rate_hz, feedback=run.feedback)
    start = default_start(skill.primitives)
    if start.orientation is None:
        raise InputError("the skill moves positions only; the robot needs orientations too")
    controller.start(start.position, start.orientation)
    duration = sum(primitive.duration for primitive in skill.primitives)
    ticks = round((duration + HOLD_S) * rate_hz)
    conditions = run_conditions(
        testbed,
        np.radians(run.setting_deg),
        conditions_rng,
        stiffness=own.stiffness,
        force=np.full(ticks, own.force_n),
        gains=(own.force_p_m_n, own.force_i_m_n_s),
    )
    fingers = FingerPair(testbed.touch, testbed.sensor_seed, fingers_rng, testbed.finger_rate_hz)
    person = corrector(testbed.corrector, ticks, testbed.world.dt, person_rng) if run.corrected else None
    pose = start.position, quaternion.matrix(start.orientation)
    log = execute(testbed.world, controller, pose, ticks, conditions, own, fingers, wrist_rng, person, engine)
    switches = np.flatnonzero(np.diff(log.primitive)) + 1
    edges = np.array([0.0, *(switches / rate_hz), duration])  # the hold at the end belongs to no primitive
    segments = np.column_stack([edges[:-1], edges[1:]])
    kind = "corrected by a person" if run.corrected else "with feedback" if run.feedback else "nominal"
    seed = " ".join(map(str, [testbed.seed, *run.seed]))
    setting = f"board roll {run.setting_deg:g} degrees"
    what = {"seed": seed, "setting": setting, "what": f"execution, {kind}"}
    return recorded_run(testbed, run.name, index, log, segments, clocks_rng, what)


def _execute(work: tuple[Run, int], skill: ReactiveSkill, testbed: TestbedParameters) -> Recording:
    return execute_run(*work, skill, testbed)


@dataclass(frozen=True)
class Bench:
    """The task on the board, as shared by the stages that execute and score it."""

    skill: ReactiveSkill  # primitives, expected traces and limits of the whole task, without networks
    nominal: np.ndarray  # (T, 4) of `nominal_orientation`
    supervision: SupervisionParameters  # how executions become supervised data
    testbed: TestbedParameters
    clock: ClockParameters  # of scored executions


def read_bench(
    data: str | Path,
    settings_deg: Sequence[float] | None,
    supervision: SupervisionParameters,
    testbed: TestbedParameters,
    clock: ClockParameters,
) -> tuple[Bench, dict[str, CouplingDataset]]:
    """Read the learned task, and its corrected demonstrations by primitive, in some settings or in all.

    The largest demonstrated coupling term limits the feedback.

    Raises InputError: a file is missing or not readable, or a setting was not recorded.
    """
    files = ScrapingFiles(Path(data))
    datasets = read_datasets(files.data / "feedback/scraping/dataset", settings_deg)
    largest = largest_coupling([one.target for one in datasets.values()])
    skill = ReactiveSkill(
        read_primitives(files.data / "primitives/scraping/primitives.safetensors"),
        read_expected(files.data / "feedback/scraping/expected"),
        limits=Limits(largest_coupling={supervision.axis: largest}),
    )
    nominal = execution_scores.nominal_orientation(files.runs("unrolls"))
    return Bench(skill, nominal, supervision, testbed, clock), datasets


def evaluate(
    bench: Bench,
    models: Mapping[str, Mapping[str, CouplingModel]],
    parameters: ExecutionParameters,
    folder: Path,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Execute a skill with every model's networks in every setting; equal numbers meet equal conditions.

    `models`: networks by model and primitive, empty without feedback. Writes runs to
    `folder/<model>/<setting>.parquet`; returns scores and traces of all models, see `execution_scores`.
    """
    skill, own, count = bench.skill, bench.supervision, parameters.runs
    names = [primitive.name for primitive in skill.primitives]
    scores, traces = [], []
    for model, networks in models.items():
        acting = replace(skill, networks=on_axis(networks, own.axis))
        planned = evaluation_runs(parameters.settings_deg, count, feedback=bool(networks))
        recordings = executions(acting, planned, bench.testbed)
        runs = {}
        for place, setting in enumerate(parameters.settings_deg):
            its = recordings[place * count : (place + 1) * count]
            runs[setting] = [synchronise(one, bench.clock.rate_hz, bench.clock.max_gap_s) for one in its]
            write_runs(runs[setting], folder / model / f"{setting:g}.parquet")
        scores.append(execution_scores.scores(model, runs, names, bench.nominal, own))
        traces.append(execution_scores.traces(model, runs, names, networks, skill.expected, own))
    return pd.concat(scores, ignore_index=True), pd.concat(traces, ignore_index=True)
