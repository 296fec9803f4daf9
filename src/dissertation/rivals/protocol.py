"""What is compared: our feedback and its rivals on the same demonstrations, executed and scored alike.

Every method is trained with 1, 2, 4, 8 and all demonstrations per tilt, and executes the task at every tilt,
tilts that nobody demonstrated among them; with all demonstrations also with starts or goals moved within and
beyond those demonstrated, and with a knock that takes the tool off the board. Equal runs of all methods meet
equal conditions.

    cost     angle between the tool and its nominal orientation (eq. IV.34), at most `CAP_RAD`, summed over
             the ticks of the primitives with feedback; of a run that diverged, the cap throughout
    goal     distance of the hand from the goal along the board at the end
    jerk     rms of the hand's jerk below `JERK_HZ`
    failed   diverged, off by `CAP_RAD` at some tick, more than `GOAL_M` from the goal, or in the second half
             of the last primitive pressing with less than half or more than one and a half times the force

Bounds were stated before any person of the study was run; tuning person 1 had been looked at.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd
from pydantic import Field

from dissertation.evidence.results import joined_results, long_table
from dissertation.rivals.imitation_data import DemonstrationParameters, Recorded, episodes, first
from dissertation.rivals.policies import RivalParameters, train
from dissertation.rivals.policy_execution import execute_policy
from dissertation.rivals.situations import UNMOVED, Situation, execute_skill
from dissertation.scraping.protocol.board_refinement import FAILURES
from dissertation.scraping.protocol.execution_scores import NOMINAL, orientation_cost
from dissertation.scraping.protocol.executions import Bench, Run, evaluation_runs
from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.core.params import Parameters
from structlearn.core.signals import derivative, low_pass
from structlearn.feedback.coupling_dataset import concatenated
from structlearn.feedback.coupling_targets import coupling_dataset, level_dataset
from structlearn.feedback.skill import Limits, ReactiveSkill, largest_coupling, on_axis
from structlearn.feedback.trainers import FeedbackNetworkParameters, TrainingParameters, train_final
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.segments import commanded_cuts

OURS = "ours"
RIVALS = ("feedforward", "chunking")
MODELS = (NOMINAL, OURS, *RIVALS)
CAP_RAD = np.radians(30.0)  # three times the largest tilt
GOAL_M, JERK_HZ = 0.01, 10.0
AS_DEMONSTRATED, KNOCKED = UNMOVED.name, "knocked"

KEYS: Mapping[str, type] = {
    "person": int,
    "model": str,
    "level": float,  # demonstrations per tilt, 0 of the primitives alone; of trials their number
    "setting": float,  # roll of the board in degrees
    "part": str,  # situation: `AS_DEMONSTRATED`, start or goal moved, or `KNOCKED`
}
UNITS = {"cost": "rad", "goal": "mm", "jerk": "m/s^3", "failed": ""}


class FeedbackParameters(FeedbackNetworkParameters):
    """Our feedback, trained also with executions on the level board."""

    pointwise: TrainingParameters


class MovedParameters(Parameters):
    """Situations that differ from those demonstrated, at one tilt."""

    setting_deg: float
    factors: dict[str, float]  # by name, e.g. beyond: shifts of start and goals relative to the range
    knock_n: tuple[float, float, float]  # force on the hand, base frame
    knock_s: tuple[float, float]  # from and to, since the start of the second primitive


class ComparisonParameters(Parameters):
    """The whole comparison. Fields: `params.yaml`, `rivals`."""

    demonstrations: DemonstrationParameters
    counts: tuple[int, ...] = Field(min_length=1)  # demonstrations per tilt
    settings_deg: tuple[float, ...] = Field(min_length=1)
    runs: int = Field(ge=1, le=100)  # executions per method, tilt and situation
    moved: MovedParameters
    seed: int = Field(ge=0)  # of training


class MethodParameters(Parameters):
    """Methods as chosen. Fields: `params.yaml`, `rival_methods`."""

    ours: FeedbackParameters
    feedforward: RivalParameters
    chunking: RivalParameters


Method = FeedbackParameters | RivalParameters | None  # None: the primitives alone
Plan = Sequence[tuple[Run, Situation]]


@dataclass(frozen=True)
class Trial:
    """A method to be trained with some demonstrations, and executed."""

    model: str
    level: float  # key in the results
    method: Method
    recorded: Recorded
    plan: Plan


def planned_runs(settings_deg: Sequence[float], runs: int) -> Plan:
    """Executions of a method, as demonstrated."""
    return [(one, UNMOVED) for one in evaluation_runs(settings_deg, runs, feedback=True)]


def moved_runs(bench: Bench, parameters: ComparisonParameters) -> Plan:
    """Executions of a method in other situations."""
    its, plan = parameters.moved, list[tuple[Run, Situation]]()
    dt = bench.testbed.world.dt
    contact = round(bench.skill.primitives[0].duration / dt) * dt
    start_s, end_s = (contact + since for since in its.knock_s)
    knocked = Situation(KNOCKED, knock_n=its.knock_n, knock_s=(start_s, end_s))
    for run in evaluation_runs([its.setting_deg], parameters.runs, feedback=True):
        corner = np.random.default_rng([bench.testbed.seed, *run.seed, 1]).choice([-1.0, 1.0], 3)
        for name, factor in its.factors.items():
            shift = tuple(factor * np.array(parameters.demonstrations.range_m) * corner)
            plan += [
                (run, Situation(f"start {name}", start=shift)),
                (run, Situation(f"goal {name}", goal=shift)),
            ]
        plan.append((run, knocked))
    return plan


def compare(
    person: int,
    bench: Bench,
    recorded: Recorded,
    parameters: ComparisonParameters,
    methods: MethodParameters,
) -> pd.DataFrame:
    """Results of one person: means over equal runs, of failures their share.

    Raises InputError: there are fewer demonstrations than `counts` asks for.
    """
    own = parameters
    if max(own.counts) > own.demonstrations.runs:
        raise InputError(
            f"rivals.counts: {max(own.counts)} demonstrations per tilt, "
            f"of which only {own.demonstrations.runs} are recorded"
        )
    some = planned_runs(own.settings_deg, own.runs)
    every = [*some, *moved_runs(bench, own)]
    trials = [Trial(NOMINAL, 0, None, {}, every)] + [
        Trial(
            model,
            count,
            getattr(methods, model),
            first(recorded, count),
            every if count == max(own.counts) else some,
        )
        for model in MODELS[1:]
        for count in own.counts
    ]
    return results_of(person, bench, trials, own.seed)


def results_of(person: int, bench: Bench, trials: Sequence[Trial], seed: int) -> pd.DataFrame:
    """Results of one person's trials: means over equal runs. `seed`: of training."""
    made, parts = parallel_map(partial(_scores, bench=bench, seed=seed), trials, "methods"), []
    for one, scores in zip(trials, made, strict=True):
        keys = {"person": person, "model": one.model, "level": one.level}
        means = scores.groupby(["part", "setting"], sort=False).mean()
        for quantity, unit in UNITS.items():
            parts.append(long_table("rivals", quantity, means[quantity].dropna(), unit, **keys))
    return joined_results(parts, KEYS)


def _scores(trial: Trial, bench: Bench, seed: int) -> pd.DataFrame:
    execute, rows = trained(bench, trial.recorded, trial.method, seed), []
    for run, situation in trial.plan:
        try:
            done = execute(run, situation=situation)
        except FAILURES:  # diverged
            done = None
        keys = {"setting": run.setting_deg, "part": situation.name}
        rows.append(keys | run_scores(bench, done, situation))
    return pd.DataFrame(rows)


def trained(bench: Bench, recorded: Recorded, method: Method, seed: int) -> partial[Demonstration]:
    """Train a method; returns what executes a run in a `situation`, by its keyword `policy` or `skill`."""
    if isinstance(method, RivalParameters):
        policy = train(episodes(bench, recorded), method, seed)
        return partial(execute_policy, policy=policy, bench=bench)
    skill = bench.skill if method is None else trained_feedback(bench, recorded, method)
    return partial(execute_skill, skill=skill, bench=bench)


def trained_feedback(bench: Bench, recorded: Recorded, own: FeedbackParameters) -> ReactiveSkill:
    """The skill with feedback, learned from corrected executions and, with a target of 0, from level ones."""
    skill, supervision = bench.skill, bench.supervision
    names = [one.name for one in skill.primitives]
    runs = {tilt: [run for _, run in its] for tilt, its in recorded.items()}
    cuts = {tilt: commanded_cuts(its, names) for tilt, its in runs.items()}
    tilted = {tilt: its for tilt, its in runs.items() if tilt}
    networks, targets = {}, []
    for name in supervision.primitives:
        expected, its = skill.expected[name], {tilt: cuts[tilt][name] for tilt in tilted}
        datasets, _ = coupling_dataset(
            tilted, its, skill.primitives[names.index(name)], expected, supervision
        )
        corrected = datasets[supervision.axis]
        level = level_dataset(runs[0.0], cuts[0.0][name], expected, supervision)
        targets.append(corrected.target)
        networks[name] = train_final(own.network, concatenated([corrected, level]), own.pointwise, own.hidden)
    limits = Limits(largest_coupling={supervision.axis: largest_coupling(targets)})
    return replace(skill, networks=on_axis(networks, supervision.axis), limits=limits)


def run_scores(bench: Bench, run: Demonstration | None, situation: Situation) -> dict[str, float]:
    """Scores of one execution, see the module; None: it has diverged."""
    skill, dt = bench.skill, 1.0 / bench.clock.rate_hz
    edges = np.cumsum([0.0, *(one.duration for one in skill.primitives)])
    scored = [skill.index(name) for name in bench.supervision.primitives]
    ticks = np.concatenate([np.arange(round(edges[i] / dt), round(edges[i + 1] / dt)) for i in scored])
    if run is None:
        return {"cost": len(ticks) * CAP_RAD, "goal": np.nan, "jerk": np.nan, "failed": 1.0}
    off = np.minimum(orientation_cost(run, bench.nominal), CAP_RAD)
    ticks = ticks[ticks < len(off)]
    last = min(round(edges[-1] / dt), len(run.time) - 1)
    away = (run.position[last] - skill.primitives[-1].position.goal - situation.goal)[:2]
    jerk = low_pass(run.position, run.dt, JERK_HZ)
    for _ in range(3):
        jerk = derivative(jerk, run.dt)
    late = slice(round(0.5 * (edges[-2] + edges[-1]) / dt), last)
    force = -run.signal("wrench")[late, 2].mean() / bench.testbed.control.force_n
    distance = float(np.linalg.norm(away))
    failed = off[ticks].max() >= CAP_RAD or distance > GOAL_M or not 0.5 <= force <= 1.5
    return {
        "cost": float(off[ticks].sum()),
        "goal": 1e3 * distance,
        "jerk": float(np.sqrt(np.mean(np.sum(jerk**2, axis=1)))),
        "failed": float(failed),
    }
