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

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd
from pydantic import Field

from dissertation.evidence.results import joined_results, long_table
from dissertation.rivals.imitation_data import (
    UNMOVED,
    DemonstrationParameters,
    Recorded,
    Situation,
    episodes,
)
from dissertation.rivals.policies import RivalParameters, train
from dissertation.rivals.policy_execution import Knock, demonstrated_motion, execute_policy, execute_skill
from dissertation.scraping.protocol.board_refinement import FAILURES
from dissertation.scraping.protocol.execution_scores import NOMINAL, orientation_cost
from dissertation.scraping.protocol.executions import Bench, Run
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
RIVALS = ("feedforward", "recurrent", "chunking")
MODELS = (NOMINAL, OURS, *RIVALS)
STAGE = "rivals_compare"
EVALUATED = 13  # first number of a run's seed, its purpose
CAP_RAD = np.radians(30.0)  # three times the largest tilt
GOAL_M, JERK_HZ = 0.01, 10.0
AS_DEMONSTRATED, KNOCKED = "as demonstrated", "knocked"

KEYS: Mapping[str, type] = {
    "person": int,
    "model": str,
    "level": float,  # demonstrations per tilt; 0 of the primitives alone
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
    factors: dict[
        str, float
    ]  # by name, e.g. beyond: size of start and goal shifts relative to the demonstrated range
    knock_n: tuple[float, float, float]  # force on the hand, base frame
    knock_s: tuple[float, float]  # from and to, since the start of the second primitive


class ComparisonParameters(Parameters):
    """The whole comparison. Fields: `params.yaml`, `rivals`."""

    demonstrations: DemonstrationParameters
    counts: tuple[int, ...] = Field(min_length=1)  # demonstrations per tilt
    settings_deg: tuple[float, ...] = Field(min_length=1)
    runs: int = Field(ge=1, le=100)  # executions per method, tilt and situation
    moved: MovedParameters
    margin_m: float = Field(ge=0)  # of the workspace around the demonstrations
    seed: int = Field(ge=0)  # of training


class MethodParameters(Parameters):
    """Methods as chosen. Fields: `params.yaml`, `rival_methods`."""

    ours: FeedbackParameters
    feedforward: RivalParameters
    recurrent: RivalParameters
    chunking: RivalParameters


Method = FeedbackParameters | RivalParameters | None  # None: the primitives alone


@dataclass(frozen=True)
class Planned:
    """One execution of the comparison."""

    run: Run
    situation: Situation
    part: str
    knock: Knock | None = None


def planned_runs(bench: Bench, parameters: ComparisonParameters, moved: bool) -> list[Planned]:
    """Executions of one method; `moved`: also those in other situations."""
    its, dt = parameters.moved, bench.testbed.world.dt
    plan = [
        Planned(run_at(EVALUATED, tilt, number), UNMOVED, AS_DEMONSTRATED)
        for tilt in parameters.settings_deg
        for number in range(parameters.runs)
    ]
    if not moved:
        return plan
    contact = round(bench.skill.primitives[0].duration / dt) * dt
    knock = Knock(contact + its.knock_s[0], contact + its.knock_s[1], np.array(its.knock_n))
    span, none = np.array(parameters.demonstrations.range_m), np.zeros(3)
    for number in range(parameters.runs):
        run = run_at(EVALUATED, its.setting_deg, number)
        corner = np.random.default_rng([bench.testbed.seed, EVALUATED, number]).choice([-1.0, 1.0], 3)
        for name, factor in its.factors.items():
            shift = factor * span * corner
            plan.append(Planned(run, Situation(shift, none), f"start {name}"))
            plan.append(Planned(run, Situation(none, shift), f"goal {name}"))
        plan.append(Planned(run, UNMOVED, KNOCKED, knock))
    return plan


def run_at(purpose: int, tilt: float, number: int) -> Run:
    """Execution that meets the same conditions with every method."""
    return Run(f"{number + 1:02d}", tilt, (purpose, 10_000 + round(10 * tilt), number), feedback=True)


def trained_feedback(bench: Bench, recorded: Recorded, own: FeedbackParameters) -> ReactiveSkill:
    """The skill with feedback, learned from corrected executions and, with a target of 0, from level ones."""
    skill, supervision = bench.skill, bench.supervision
    names = [one.name for one in skill.primitives]
    cuts = {tilt: commanded_cuts(runs, names) for tilt, runs in recorded.runs.items()}
    tilted = {tilt: runs for tilt, runs in recorded.runs.items() if tilt}
    networks, targets = {}, []
    for name in supervision.primitives:
        expected, its = skill.expected[name], {tilt: cuts[tilt][name] for tilt in tilted}
        primitive = skill.primitives[names.index(name)]
        datasets, _ = coupling_dataset(tilted, its, primitive, expected, supervision)
        corrected = datasets[supervision.axis]
        level = level_dataset(recorded.runs[0.0], cuts[0.0][name], expected, supervision)
        targets.append(corrected.target)
        together = concatenated([corrected, level])
        networks[name] = train_final(own.network, together, own.pointwise, own.hidden)
    limits = Limits(largest_coupling={supervision.axis: largest_coupling(targets)})
    return replace(skill, networks=on_axis(networks, supervision.axis), limits=limits)


def method_scores(
    bench: Bench,
    recorded: Recorded,
    method: Method,
    plan: Sequence[Planned],
    margin_m: float,
    seed: int,
) -> tuple[pd.DataFrame, float, float]:
    """Train a method and execute a plan: `run_scores` of each, and seconds of training and of executions."""
    begin = time.process_time()
    if isinstance(method, RivalParameters):
        seen = episodes(bench, recorded)
        policy = train(seen, method, seed)
        limits = demonstrated_motion(seen, bench.testbed.finger_rate_hz, margin_m)
        execute = partial(execute_policy, policy=policy, limits=limits, bench=bench)
    else:
        skill = bench.skill if method is None else trained_feedback(bench, recorded, method)
        execute = partial(execute_skill, skill=skill, bench=bench)
    trained, rows = time.process_time(), []
    for one in plan:
        try:
            done = execute(one.run, situation=one.situation, knock=one.knock)
        except FAILURES:  # diverged
            done = None
        keys = {"setting": one.run.setting_deg, "part": one.part, "run": one.run.name}
        rows.append(keys | run_scores(bench, done, one.situation))
    return pd.DataFrame(rows), trained - begin, time.process_time() - trained


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


def compare(
    person: int,
    bench: Bench,
    recorded: Recorded,
    parameters: ComparisonParameters,
    methods: MethodParameters,
) -> pd.DataFrame:
    """Results of one person: means over equal runs, of failures their share. Prints seconds, which differ.

    Raises InputError: there are fewer demonstrations than `counts` asks for.
    """
    own = parameters
    if max(own.counts) > own.demonstrations.runs:
        raise InputError(
            f"rivals.counts: {max(own.counts)} demonstrations per tilt, "
            f"of which only {own.demonstrations.runs} are recorded"
        )
    work = [(NOMINAL, 0)] + [(model, count) for model in MODELS[1:] for count in own.counts]
    made = parallel_map(
        partial(_compared, bench=bench, recorded=recorded, parameters=own, methods=methods),
        work,
        "methods by demonstrations",
    )
    parts = []
    for (model, count), (scores, training, executing) in zip(work, made, strict=True):
        print(
            f"{model}, {count:g} demonstrations per tilt: trained in {training:.1f} s, "
            f"{len(scores)} executions in {executing:.1f} s"
        )
        parts += list(as_results(scores, person=person, model=model, level=count))
    return joined_results(parts, KEYS)


def _compared(
    work: tuple[str, float],
    bench: Bench,
    recorded: Recorded,
    parameters: ComparisonParameters,
    methods: MethodParameters,
) -> tuple[pd.DataFrame, float, float]:
    model, count = work
    nominal = model == NOMINAL
    plan = planned_runs(bench, parameters, moved=nominal or count == max(parameters.counts))
    method: Method = None if nominal else getattr(methods, model)
    shown = recorded if nominal else recorded.first(int(count))
    return method_scores(bench, shown, method, plan, parameters.margin_m, parameters.seed)


def as_results(scores: pd.DataFrame, **keys: object) -> Iterator[pd.DataFrame]:
    """Rows of each score, its mean over equal runs."""
    means = scores.groupby(["part", "setting"], sort=False)[list(UNITS)].mean()
    for quantity, unit in UNITS.items():
        yield long_table(STAGE, quantity, means[quantity].dropna(), unit, **keys)
