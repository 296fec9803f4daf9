"""What is compared past spheres: learned avoidance and its rivals on the same demonstrations.

Every method is trained with 1, 2, 4, 8 and all demonstrations at each of 40 places, and reaches past spheres
there and past the 63 that nobody demonstrated (IV.8.7). Per reach, over its duration,

    hit      the hand has come within the sphere's radius of its centre
    goal     distance from the goal at the end
    detour   largest distance from the reach without avoidance, at equal times
    failed   hit, or more than `GOAL_M` from the goal at the end

The trials that choose a form of each method learn at places of another scene, and are executed there and at
places of a third one, where nobody demonstrated; the lowest mean of failed over these and people is chosen.

Bounds were stated before any person of the study was run; tuning people had been looked at.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
import pandas as pd
from pydantic import Field

from dissertation.evidence.results import joined_results, long_table
from dissertation.obstacles.protocol.avoidance_protocols import (
    AvoidanceEvaluationParameters,
    Situations,
    unrolled,
    unseen_scenarios,
)
from dissertation.obstacles.protocol.avoidance_scores import closest_approaches
from dissertation.obstacles.world.reaching_person import AvoiderParameters
from dissertation.obstacles.world.scenarios import SceneParameters, scenarios
from dissertation.rivals.choice import DrawingParameters, drawn_methods
from dissertation.rivals.policies import RivalParameters, train
from dissertation.rivals.protocol import KEYS, MODELS, NOMINAL
from dissertation.rivals.reaching.reaches import (
    SPHERE,
    Reaches,
    coupling_samples,
    demonstrated,
    executed_reaches,
    past_places,
    reach_episodes,
)
from structlearn.avoidance.avoidance_dataset import AvoidanceDataParameters, to_local
from structlearn.avoidance.avoiding_unroll import no_coupling
from structlearn.avoidance.features import CouplingModel
from structlearn.avoidance.network_training import EnsembleParameters, fit_networks
from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.core.params import Parameters
from structlearn.core.stage import stage_parameters
from structlearn.primitives.position import PositionPrimitive
from structlearn.primitives.vector import sample_count

GOAL_M = 0.05
NEAR, FAR, OTHER, UNSEEN = "near", "far", "other", "unseen"
UNITS = {"hit": "", "goal": "mm", "detour": "mm", "failed": ""}


class ReachingParameters(Parameters):
    """The comparison past spheres. Fields: `params.yaml`, `reaching`."""

    counts: tuple[int, ...] = Field(min_length=1)  # demonstrations per place
    other_seed: int = Field(ge=0)  # of places where trials are executed and nobody demonstrates
    seed: int = Field(ge=0)  # of training


class ReachingMethodParameters(Parameters):
    """Methods as chosen. Fields: `params.yaml`, `reaching_methods`."""

    ours: EnsembleParameters
    feedforward: RivalParameters
    chunking: RivalParameters


class ReachingTrialParameters(DrawingParameters):
    """Trials past spheres. Fields: `params.yaml`, `reaching_trials`."""

    methods: ClassVar[type[Parameters]] = ReachingMethodParameters


ReachingMethod = EnsembleParameters | RivalParameters | None  # None: without avoidance


@dataclass(frozen=True)
class ReachingTrial:
    """A method to be trained with some demonstrations."""

    model: str
    level: float  # key in the results
    method: ReachingMethod
    shown: Reaches


@dataclass(frozen=True)
class ReachingBench:
    """How reaches are demonstrated, learned from and made, as in the obstacle testbed."""

    scene: SceneParameters
    data: AvoidanceDataParameters
    evaluation: AvoidanceEvaluationParameters

    @property
    def dt(self) -> float:
        """Sampling interval of reaches in s."""
        return 1.0 / self.evaluation.rate_hz


Tested = Sequence[tuple[Situations, Sequence[str]]]
"""Reaches that are made, and the part that each belongs to."""


def demonstrated_person(tuning: bool) -> tuple[Reaches, ReachingBench]:
    """Demonstrations of the person whom `params.yaml` names, in its scene or in that of `tuning`."""
    people = stage_parameters("obstacle_demonstrator", AvoiderParameters)
    scene = stage_parameters("obstacle_scene", SceneParameters)
    if tuning:
        scene = scene.model_copy(update={"seed": scene.tuning_seed})
    data = stage_parameters("obstacle_dataset", AvoidanceDataParameters)
    evaluation = stage_parameters("obstacle_evaluation", AvoidanceEvaluationParameters)
    return demonstrated(scene, people, data), ReachingBench(scene, data, evaluation)


def compare_reaches(
    reaches: Reaches,
    bench: ReachingBench,
    parameters: ReachingParameters,
    methods: ReachingMethodParameters,
) -> pd.DataFrame:
    """Results of one person: means over the reaches of a part, of hits and failures their shares.

    Raises InputError: there are fewer demonstrations than `counts` asks for.
    """
    most, made = max(parameters.counts), min(len(its) for its in reaches.sets)
    if most > made:
        raise InputError(f"reaching.counts: {most} demonstrations per place, of which only {made} are made")
    unseen = unseen_scenarios(reaches.baseline)
    tested = [_demonstrated_places(reaches, bench), (unseen, [UNSEEN] * len(unseen.numbers))]
    trials = [ReachingTrial(NOMINAL, 0, None, reaches)] + [
        ReachingTrial(model, count, getattr(methods, model), reaches.first(count))
        for model in MODELS[1:]
        for count in parameters.counts
    ]
    return _results(trials, tested, bench, parameters.seed)


def try_reaches(
    reaches: Reaches,
    bench: ReachingBench,
    parameters: ReachingParameters,
    trials: ReachingTrialParameters,
) -> pd.DataFrame:
    """Results of all trials on one person, whose numbers are their level."""
    others = scenarios(bench.scene.model_copy(update={"seed": parameters.other_seed}), [SPHERE])
    other = past_places(others, reaches, bench.data)
    tested = [_demonstrated_places(reaches, bench), (other, [OTHER] * len(other.numbers))]
    attempts = [
        ReachingTrial(model, number, method, reaches.first(trials.count))
        for model in MODELS[1:]
        for number, method in enumerate(drawn_methods(model, trials))
    ]
    return _results(attempts, tested, bench, parameters.seed)


def failures(results: pd.DataFrame, model: str) -> pd.Series:
    """Mean share of failed reaches over parts and people, by trial; the lowest is chosen."""
    rows = results[(results["quantity"] == "failed") & (results["model"] == model)]
    return rows.groupby("level")["value"].mean()


def _demonstrated_places(reaches: Reaches, bench: ReachingBench) -> tuple[Situations, list[str]]:
    its = past_places(reaches.places, reaches, bench.data)
    return its, [NEAR if number <= bench.scene.near_settings else FAR for number in its.numbers]


def _results(
    trials: Sequence[ReachingTrial], tested: Tested, bench: ReachingBench, seed: int
) -> pd.DataFrame:
    scores = partial(_scores, tested=tested, bench=bench, seed=seed)
    made, parts = parallel_map(scores, trials, "methods"), []
    for one, its in zip(trials, made, strict=True):
        keys = {"person": one.shown.person, "model": one.model, "level": one.level, "setting": 0.0}
        means = its.groupby("part", sort=False).mean()
        for quantity, unit in UNITS.items():
            parts.append(long_table("rivals", quantity, means[quantity].dropna(), unit, **keys))
    return joined_results(parts, KEYS)


def _scores(trial: ReachingTrial, tested: Tested, bench: ReachingBench, seed: int) -> pd.DataFrame:
    """Train a method, and score each of its reaches."""
    baseline, tables = trial.shown.baseline, []
    reach = trained_reaches(trial.shown, trial.method, bench, seed)
    for situation, part in tested:
        bare = _positions(situation, no_coupling, baseline, bench)
        scores = reach_scores(reach(situation), bare, situation, to_local(baseline.goal, baseline), bench.dt)
        tables.append(scores.assign(part=part))
    return pd.concat(tables, ignore_index=True)


def trained_reaches(
    shown: Reaches, method: ReachingMethod, bench: ReachingBench, seed: int
) -> Callable[[Situations], np.ndarray]:
    """Train a method; returns what gives positions (B, T, 3) m of its reaches in a situation."""
    if isinstance(method, RivalParameters):
        policy = train(reach_episodes(shown, bench.data), method, seed)
        return lambda situation: executed_reaches(policy, shown.baseline, situation.obstacles[0], bench.dt)
    coupling: CouplingModel = no_coupling
    if method is not None:
        coupling = fit_networks([coupling_samples(shown, bench.data)], method, "avoidance")
    return partial(_positions, coupling=coupling, baseline=shown.baseline, bench=bench)


def _positions(
    situation: Situations, coupling: CouplingModel, baseline: PositionPrimitive, bench: ReachingBench
) -> np.ndarray:
    """Positions (B, T, 3) m of the primitive's reaches over its duration, with a coupling term."""
    its = bench.evaluation
    path = unrolled(situation, coupling, baseline, its, its.postprocessing).path
    return path.position[:, : sample_count(baseline.duration, bench.dt)]


def reach_scores(
    position: np.ndarray, bare: np.ndarray, situation: Situations, goal: np.ndarray, dt: float
) -> pd.DataFrame:
    """Scores of reaches, see the module; `position` and, without avoidance, `bare` (B, T, 3) m.

    A path that is not finite hits, and has neither goal nor detour.
    """
    time = dt * np.arange(position.shape[1])
    distance, _ = closest_approaches(time, position, situation.obstacles)
    left = np.linalg.norm(position[:, -1] - goal, axis=-1)
    hit = ~(distance > 0.0)
    detour = np.linalg.norm(position - bare, axis=-1).max(axis=1)
    scores = {"hit": hit, "goal": 1e3 * left, "detour": 1e3 * detour, "failed": hit | ~(left <= GOAL_M)}
    return pd.DataFrame(scores).astype(float)
