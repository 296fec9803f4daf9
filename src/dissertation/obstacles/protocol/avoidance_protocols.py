"""Situations in which avoidance models are tested (IV.8.4-8.7), with their unrolls and scores.

trained       the demonstrated scenarios
unseen        63 small spheres close to the reach
moving        the same spheres, crossing the reach just when the hand would be there (not in the dissertation)
pair          two of them at once (not in the dissertation)
goal_change   the same spheres while the goal moves (not in the dissertation)
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
import pandas as pd
from pydantic import Field, PositiveInt, model_validator

from dissertation.obstacles.protocol.avoidance_scores import LATE_FACTOR, unroll_scores
from dissertation.obstacles.world.scenarios import UNSEEN_RADIUS_M, Scenario, unseen_centres
from structlearn.avoidance.avoidance_dataset import baseline_axes, to_local
from structlearn.avoidance.avoiding_unroll import AvoidancePaths, GoalChange, no_coupling, unroll_avoiding
from structlearn.avoidance.features import CouplingModel
from structlearn.avoidance.learned_models import ALL, SETTING, AvoidanceModels
from structlearn.avoidance.postprocessing import PUBLISHED_ONLY, PostprocessingParameters
from structlearn.avoidance.shapes import (
    CLOUD_COUNT,
    SHAPES,
    CloudBatch,
    Shape,
    cloud_batch,
    constant_velocity,
    ringed_sphere,
)
from structlearn.core.params import Parameters
from structlearn.primitives.position import PositionPrimitive

TRAINED, UNSEEN, MOVING, PAIR, GOAL_CHANGE = "trained", "unseen", "moving", "pair", "goal_change"

NO_MODEL = "none"  # baseline without coupling term

LIMITED, PUBLISHED = "limited", "published"
"""Post-processing: the published rules with limits at the goal, or alone."""

PAIR_SPACING_M = 0.2  # least distance along the reach between the centres of a pair, to leave a gap


class AvoidanceEvaluationParameters(Parameters):
    """Evaluation of the avoidance models."""

    rate_hz: float = Field(ge=25, le=1000)
    kept_every: PositiveInt
    speeds_m_s: tuple[float, ...]
    pairs: PositiveInt
    pair_seed: int = Field(ge=0)
    goal_change_s: float = Field(gt=0)
    goal_shift_m: tuple[float, float, float]
    postprocessing: PostprocessingParameters

    @model_validator(mode="after")
    def _limited(self) -> Self:
        if self.postprocessing.late_factor > LATE_FACTOR:
            raise ValueError(f"late_factor must be at most {LATE_FACTOR:g}, where goals are scored")
        return self


@dataclass(frozen=True)
class Situations:
    """A batch of reaches past obstacles."""

    protocol: str
    obstacle: Shape
    numbers: np.ndarray  # (B,) of the setting, sphere or pair, from 1
    obstacles: tuple[CloudBatch, ...]  # one or two per reach
    speed: np.ndarray  # (B,) m/s of the obstacles
    scenarios: np.ndarray | None = None  # (B,) scenario index in the dataset; None if not demonstrated
    goal_change: GoalChange | None = None

    @property
    def keys(self) -> pd.DataFrame:
        """Columns `protocol`, `obstacle`, `scenario` and `speed_m_s` of each reach."""
        keys = {"protocol": self.protocol, "obstacle": self.obstacle}
        return pd.DataFrame(keys | {"scenario": self.numbers, "speed_m_s": self.speed})

    def where(self, rows: np.ndarray) -> Self:
        """Select reaches by a mask (B,); obstacles must be at rest."""
        return replace(
            self,
            numbers=self.numbers[rows],
            obstacles=tuple(one.where(rows) for one in self.obstacles),
            speed=self.speed[rows],
            scenarios=None if self.scenarios is None else self.scenarios[rows],
        )


@dataclass(frozen=True)
class Learner:
    """Baseline and models learned from one person's demonstrations."""

    person: int  # seed
    baseline: PositionPrimitive
    models: AvoidanceModels
    own: np.ndarray  # (K,) ascending indices of the scenarios with models per setting


class Contender(NamedTuple):
    """A coupling model, and the reaches it applies to."""

    model: str  # kind
    learned_from: str  # see `learned_models.AvoidanceModels`
    coupling: CouplingModel
    rows: np.ndarray  # (B,) mask of the reaches in a batch


def situations(
    scenarios: Sequence[Scenario],
    baseline: PositionPrimitive,
    parameters: AvoidanceEvaluationParameters,
    cloud_count: int = CLOUD_COUNT,
) -> list[Situations]:
    """Situations of all protocols; the trained ones are split by shape."""
    shapes = [shape for shape in SHAPES if any(scenario.shape == shape for scenario in scenarios)]
    return [
        *(trained_scenarios(scenarios, shape, baseline, cloud_count) for shape in shapes),
        unseen_scenarios(baseline),
        moving(baseline, parameters),
        pairs(baseline, parameters),
        goal_change(baseline, parameters),
    ]


def trained_scenarios(
    scenarios: Sequence[Scenario], shape: Shape, baseline: PositionPrimitive, cloud_count: int = CLOUD_COUNT
) -> Situations:
    """The demonstrated scenarios of one shape."""
    places = np.array([place for place, scenario in enumerate(scenarios) if scenario.shape == shape])
    clouds = np.stack([scenarios[place].obstacle.cloud(cloud_count) for place in places])
    obstacles = cloud_batch(to_local(clouds, baseline))
    numbers = np.array([scenarios[place].setting for place in places])
    return Situations(TRAINED, shape, numbers, (obstacles,), np.zeros(len(places)), places)


def unseen_scenarios(baseline: PositionPrimitive) -> Situations:
    """The grid of unseen spheres around the baseline (IV.8.7)."""
    centres = unseen_centres(baseline.start, baseline.goal)
    clouds = to_local(ringed_sphere(centres, UNSEEN_RADIUS_M), baseline)
    obstacles = cloud_batch(clouds, to_local(centres, baseline), UNSEEN_RADIUS_M)
    numbers = np.arange(1, len(centres) + 1)
    return Situations(UNSEEN, "sphere", numbers, (obstacles,), np.zeros(len(centres)))


def moving(baseline: PositionPrimitive, parameters: AvoidanceEvaluationParameters) -> Situations:
    """Spheres that cross the reach when the baseline is closest; even numbers move to the left."""
    grid = unseen_scenarios(baseline)
    spheres = grid.obstacles[0]
    path = baseline.unroll(1.0 / parameters.rate_hz)
    way = np.linalg.norm(to_local(path.position, baseline) - spheres.centre[:, None], axis=-1)
    passing = path.time[way.argmin(axis=1)]  # (63,)
    count, speeds = len(passing), np.array(parameters.speeds_m_s)
    speed = np.repeat(speeds, count)
    velocity = np.zeros((len(speed), 3))
    velocity[:, 1] = speed * np.tile(np.where(grid.numbers % 2 == 0, 1.0, -1.0), len(speeds))
    ahead = velocity * np.tile(passing, len(speeds))[:, None]
    points = np.tile(spheres.points, (len(speeds), 1, 1)) - ahead[:, None]
    centres = np.tile(spheres.centre, (len(speeds), 1)) - ahead
    obstacles = cloud_batch(points, centres, UNSEEN_RADIUS_M, constant_velocity(velocity))
    return Situations(MOVING, "sphere", np.tile(grid.numbers, len(speeds)), (obstacles,), speed)


def pairs(baseline: PositionPrimitive, parameters: AvoidanceEvaluationParameters) -> Situations:
    """Random pairs of spheres of the grid, at least `PAIR_SPACING_M` apart along the reach."""
    spheres = unseen_scenarios(baseline).obstacles[0]
    along = spheres.centre[:, 0]
    first, second = np.nonzero(along[None] - along[:, None] >= PAIR_SPACING_M)
    rng = np.random.default_rng(parameters.pair_seed)
    chosen = np.sort(rng.permutation(len(first))[: parameters.pairs])
    obstacles = (spheres.where(first[chosen]), spheres.where(second[chosen]))
    return Situations(PAIR, "sphere", np.arange(1, len(chosen) + 1), obstacles, np.zeros(len(chosen)))


def goal_change(baseline: PositionPrimitive, parameters: AvoidanceEvaluationParameters) -> Situations:
    """The grid of spheres, with a goal that moves during the reach."""
    shift = baseline_axes(baseline) @ np.array(parameters.goal_shift_m)
    change = GoalChange(parameters.goal_change_s, baseline.goal + shift)
    return replace(unseen_scenarios(baseline), protocol=GOAL_CHANGE, goal_change=change)


def contenders(learner: Learner, situation: Situations) -> Iterator[Contender]:
    """No model, and all models that apply to a situation.

    For demonstrated scenarios: models of the setting, of its shape and of all shapes; otherwise models of
    every shape and of all.
    """
    every = np.ones(len(situation.numbers), dtype=bool)
    yield Contender(NO_MODEL, "", no_coupling, every)
    shapes = SHAPES if situation.scenarios is None else (situation.obstacle,)
    for kind, found in learner.models.items():
        if situation.scenarios is not None and SETTING in found:
            rows = np.isin(situation.scenarios, learner.own)
            if rows.any():
                stack = found[SETTING].take(np.searchsorted(learner.own, situation.scenarios[rows]))
                yield Contender(kind, SETTING, stack, rows)
        yield from (Contender(kind, name, found[name], every) for name in (*shapes, ALL) if name in found)


def evaluate_avoidance(
    work: tuple[Learner, Situations], parameters: AvoidanceEvaluationParameters, with_paths_of: int
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Unroll all contenders; for trained and unseen obstacles with both kinds of rules.

    Returns the columns of `avoidance_scores.unroll_scores` by `person`, `protocol`, `rules`, `model`,
    `learned_from`, `obstacle`, `scenario` (number) and `speed_m_s`; and the paths with rules `limited` of the
    person `with_paths_of`: the same keys without person and rules, `time_s`, positions `x_m`, ... in the base
    frame, and applied coupling terms `coupling_x`, ... in the local frame, m.
    """
    learner, situation = work
    rules = {LIMITED: parameters.postprocessing}
    if situation.protocol in (TRAINED, UNSEEN):
        published = {"passed_decay_per_m2": parameters.postprocessing.passed_decay_per_m2}
        rules[PUBLISHED] = PUBLISHED_ONLY.model_copy(update=published)
    bare = unrolled(situation, no_coupling, learner.baseline, parameters, parameters.postprocessing)
    tables, paths = [], []
    for contender in contenders(learner, situation):
        its = situation if contender.rows.all() else situation.where(contender.rows)
        keys = its.keys.assign(model=contender.model, learned_from=contender.learned_from)
        for name, postprocessing in rules.items():
            found = bare  # the same for all rules
            if contender.model != NO_MODEL:
                found = unrolled(its, contender.coupling, learner.baseline, parameters, postprocessing)
            scored = unroll_scores(found, its.obstacles, bare.path.position[contender.rows])
            tables.append(pd.concat([keys.assign(person=learner.person, rules=name), scored], axis=1))
            if name == LIMITED and learner.person == with_paths_of:
                paths.append(_path_table(keys, found, parameters.kept_every))
    return pd.concat(tables, ignore_index=True), pd.concat(paths or [pd.DataFrame()], ignore_index=True)


def unrolled(
    situation: Situations,
    coupling: CouplingModel,
    baseline: PositionPrimitive,
    parameters: AvoidanceEvaluationParameters,
    postprocessing: PostprocessingParameters,
) -> AvoidancePaths:
    """All reaches of a situation with one coupling model, over `LATE_FACTOR` durations."""
    obstacles, dt, change = situation.obstacles, 1.0 / parameters.rate_hz, situation.goal_change
    return unroll_avoiding(
        baseline, coupling, obstacles, dt, postprocessing, until_factor=LATE_FACTOR, goal_change=change
    )


def _path_table(keys: pd.DataFrame, paths: AvoidancePaths, kept_every: int) -> pd.DataFrame:
    kept = slice(None, None, kept_every)
    time = paths.path.time[kept]
    table = keys.iloc[np.repeat(np.arange(len(keys)), len(time))].reset_index(drop=True)
    table["time_s"] = np.tile(time, len(keys))
    for name, values in (("{}_m", paths.in_base_frame.position), ("coupling_{}", paths.coupling)):
        flat = values[:, kept].astype(np.float32).reshape(-1, 3)
        table[[name.format(axis) for axis in "xyz"]] = flat
    return table
