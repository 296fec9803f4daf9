"""Models of reaching through scenes, learned from people, and their reaches in other scenes (IV.8.4).

Ensemble members also see every sample displaced, as in `network_training`; otherwise closed-loop behaviour is
good only near demonstrated paths. With the demonstrated coupling term a displacement decays by the
primitive's own attraction, which is too slow in narrow gaps, so displaced targets have an additional
stiffness k:

    c(x + dx, v + dv) = c(x, v) - k dx
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from structlearn.avoidance.avoidance_dataset import AvoidanceDataset, concatenated_samples
from structlearn.avoidance.avoidance_network import averaged
from structlearn.avoidance.features import MIRROR, MIRROR_SIGNS, CouplingModel, obstacle_features
from structlearn.avoidance.levenberg_marquardt import SEEN
from structlearn.avoidance.look_ahead import CostToGo, mirror_signs, scene_cost_to_go, scene_features
from structlearn.avoidance.network_training import (
    AvoidanceNetworkParameters,
    EnsembleParameters,
    stacked,
    trained_member,
)
from structlearn.avoidance.postprocessing import Deadline, GoalReach, post_processed
from structlearn.avoidance.rai_2014 import fit_human_inspired
from structlearn.avoidance.scene_reaches import SceneLearningParameters, SceneReach
from structlearn.core.parallel import parallel_map
from structlearn.core.signals import minimum_jerk
from structlearn.feedback.coupling import position_target
from structlearn.primitives import canonical, transformation
from structlearn.primitives.position import fit_position
from structlearn.primitives.trajectory import Trajectory
from structlearn.primitives.vector import VectorPrimitive

NONE, HUMAN_INSPIRED, PUBLISHED = "none", "human_inspired", "published"
NEAREST, SCENE, PLANNED = "nearest", "scene", "planned"
"""The baseline alone; Rai et al.; the published features and network; the same features with our training;
the scene's features with the same network and training; the planned path itself."""

STRAIGHT_SHARE = 0.1  # of a reach's length, off a straight line: the baseline is learned from such reaches
RETURN_STIFFNESS = 60.0  # m of coupling per m off the path, which leads displaced samples back to it
END_LIMIT_M = 0.02  # off the baseline's end that coupling may leave the hand, which must be at its goal
RETURN_COUPLING = 20.0  # m, coupling that may be needed to keep this limit, as for one obstacle
TEXT_DECAY_PER_M2 = 10.0  # k of the post-processing, as published
PLANNED_STEP_M, PLANNED_MOST_M = 0.005, 2.0  # spacing and largest length of a planned path
TAU = canonical.time_constant(1.0)  # time constant in durations


@dataclass(frozen=True)
class Scenes:
    """B scenes as inputs of the models."""

    start: np.ndarray  # (B, 3) m, base frame
    frame: np.ndarray  # (B, 3, 3) local to base
    goal: np.ndarray  # (B, 3) m, local frame
    clouds: np.ndarray  # (B, O, P, 3) m, local frame, surface points; scenes with fewer obstacles repeat one
    costs_to_go: Sequence[CostToGo]  # one per scene

    def __len__(self) -> int:
        return len(self.start)

    def take(self, places: Sequence[int]) -> Self:
        """Scenes of the given indices, which may repeat."""
        arrays = (self.start[places], self.frame[places], self.goal[places], self.clouds[places])
        return type(self)(*arrays, [self.costs_to_go[place] for place in places])

    def features(self, scene: int, position: np.ndarray, scaled_velocity: np.ndarray) -> np.ndarray:
        """`look_ahead.scene_features` of states (N, 3), (N, 3) in one of the scenes."""
        place = (self.start[scene], self.frame[scene], self.goal[scene])
        return scene_features(self.costs_to_go[scene], position, scaled_velocity, *place)


@dataclass(frozen=True)
class SceneStates:
    """Samples of reaches, each through its own scene."""

    scene: np.ndarray  # (S,) index in `Scenes`
    time: np.ndarray  # (S,) in durations
    position: np.ndarray  # (S, 3) m, local frame, relative to the start
    scaled_velocity: np.ndarray  # (S, 3) tau v, m
    target: np.ndarray  # (S, 3) m, coupling term

    def where(self, mask: np.ndarray) -> Self:
        """Samples selected by a mask (S,) or by indices."""
        return type(self)(**{name: values[mask] for name, values in vars(self).items()})


def scene_states(paths: Sequence[Trajectory], baseline: VectorPrimitive, keep_every: int) -> SceneStates:
    """Every n-th state of local paths, path b in scene b, with its coupling target (eq. IV.23)."""
    kept = slice(None, None, keep_every)
    parts = [
        SceneStates(
            scene=np.full(len(path.time[kept]), place),
            time=path.time[kept],
            position=path.position[kept],
            scaled_velocity=TAU * path.velocity[kept],
            target=position_target(path, baseline, goal=path.position[-1])[kept],
        )
        for place, path in enumerate(paths)
    ]
    return concatenated_samples(parts)


def displaced_states(
    states: SceneStates, parameters: EnsembleParameters, stream: Sequence[int]
) -> SceneStates:
    """Training states of one ensemble member: some reaches, each sample as recorded and once displaced."""
    rng = np.random.default_rng([parameters.training.seed, *stream, SEEN])
    chosen = rng.permutation(np.unique(states.scene))[: parameters.demonstrations]
    seen = states.where(np.isin(states.scene, chosen))
    displacement, faster = rng.standard_normal((2, len(seen.time), 3))
    displacement, faster = parameters.displaced_m * displacement, parameters.displaced_velocity_m * faster
    beside = replace(
        seen,
        position=seen.position + displacement,
        scaled_velocity=seen.scaled_velocity + faster,
        target=seen.target - RETURN_STIFFNESS * displacement,
    )
    return concatenated_samples([seen, beside])


def samples_of_scene(states: SceneStates, scenes: Scenes) -> AvoidanceDataset:
    """States with the features of their scenes (`look_ahead.scene_features`)."""
    return _samples(states, scenes.features)


def with_mirror_images(dataset: AvoidanceDataset, signs: np.ndarray) -> AvoidanceDataset:
    """Samples and their mirror images; `signs` (F,): `mirror_signs` or `MIRROR_SIGNS`."""
    image = replace(dataset, features=dataset.features * signs, target=dataset.target * MIRROR)
    return concatenated_samples([dataset, image])


def samples_of_nearest(states: SceneStates, scenes: Scenes) -> AvoidanceDataset:
    """States with the published features of the currently nearest obstacle."""
    return _samples(states, lambda b, x, v: nearest_seen(x, v, scenes.clouds[b : b + 1])[0])


def _samples(states: SceneStates, see: Callable[..., np.ndarray]) -> AvoidanceDataset:
    """States with features from `see`: (scene, positions, tau v) -> features (N, F)."""
    order = np.argsort(states.scene, kind="stable")
    scenes, starts = np.unique(states.scene[order], return_index=True)
    parts = [
        see(int(b), states.position[rows], states.scaled_velocity[rows])
        for b, rows in zip(scenes, np.split(order, starts[1:]), strict=True)
    ]
    columns = np.empty((len(order), parts[0].shape[1]))
    columns[order] = np.concatenate(parts)
    p, u = canonical.phase(states.time, TAU)
    none = np.zeros(len(order), dtype=int)
    return AvoidanceDataset(columns, states.target, p, u, none, states.scene, states.time)


def nearest_seen(
    position: np.ndarray, scaled_velocity: np.ndarray, clouds: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The published features (B, 17) of the nearest of clouds (B, O, P, 3), and x (B, P) of its points in m.

    The clouds of one scene (1, O, P, 3) may serve all states.
    """
    clouds = np.broadcast_to(clouds, (len(position), *clouds.shape[1:]))
    every = obstacle_features(position[:, None], scaled_velocity[:, None], 1.0, clouds, clouds.mean(axis=2))
    nearest = np.linalg.norm(every[..., [3, 6, 9]], axis=-1).argmin(axis=1)
    rows = np.arange(len(position))
    return every[rows, nearest], clouds[rows, nearest, :, 0]


@dataclass(frozen=True)
class SceneModels:
    """Baseline and models learned from some people."""

    baseline: VectorPrimitive  # without obstacles, with duration 1
    models: Mapping[str, CouplingModel]  # by kind


def reach_scenes(reaches: Sequence[SceneReach], parameters: SceneLearningParameters) -> Scenes:
    """Scenes of the given reaches."""
    goals = [reach.in_base_frame[-1] for reach in reaches]
    most, clouds = max(len(reach.obstacles) for reach in reaches), []
    for reach in reaches:
        filled = (*reach.obstacles, *[reach.obstacles[0]] * (most - len(reach.obstacles)))
        surfaces = np.array([shape.cloud(parameters.cloud_count) for shape in filled])
        clouds.append((surfaces - reach.start) @ reach.frame)
    return Scenes(
        start=np.array([reach.start for reach in reaches]),
        frame=np.array([reach.frame for reach in reaches]),
        goal=np.array([reach.goal for reach in reaches]),
        clouds=np.array(clouds),
        costs_to_go=[
            scene_cost_to_go([*reach.obstacles, *reach.walls], reach.start, goal, parameters.look_ahead)
            for reach, goal in zip(reaches, goals, strict=True)
        ],
    )


def straight_baseline(reaches: Sequence[SceneReach]) -> VectorPrimitive:
    """Primitive of the reaches that are nearly straight, or else of the straightest one.

    Its forcing term scales with the length of the reach.
    """
    most = max(STRAIGHT_SHARE, min(reach.bend for reach in reaches))
    straight = [reach.path for reach in reaches if reach.bend <= most]
    return fit_position(straight, scaled=(True, False, False), frame="reach").local


def learn_scene_models(
    reaches: Sequence[SceneReach],
    scenes: Scenes,
    parts: Sequence[Sequence[int]],
    parameters: SceneLearningParameters,
) -> list[SceneModels]:
    """Learn from each of several sets of reaches, given by indices; networks train over processes."""
    sets = [
        _training_sets([reaches[place] for place in places], scenes.take(places), number, parameters)
        for number, places in enumerate(parts)
    ]
    work = [
        (whole, network, (number, member), seen)
        for number, (_, _, networks) in enumerate(sets)
        for network, whole, by_member in networks.values()
        for member, seen in enumerate(by_member)
    ]
    layers = iter(parallel_map(trained_member, work, "networks of reaches through scenes"))
    learned = []
    for baseline, nearest, networks in sets:
        models: dict[str, CouplingModel] = {
            HUMAN_INSPIRED: fit_human_inspired(nearest.features, nearest.target)
        }
        for kind, (network, whole, by_member) in networks.items():
            models[kind] = stacked([averaged([next(layers) for _ in by_member])], [whole], network)
        learned.append(SceneModels(baseline, models))
    return learned


TrainingSets = tuple[AvoidanceNetworkParameters, AvoidanceDataset, Sequence[AvoidanceDataset]]
"""Training parameters of a network, its training samples, and the samples that each member sees."""


def _training_sets(
    reaches: Sequence[SceneReach], scenes: Scenes, number: int, parameters: SceneLearningParameters
) -> tuple[VectorPrimitive, AvoidanceDataset, dict[str, TrainingSets]]:
    """Baseline, samples with the published features, and training data by kind of network, of a set."""
    baseline = straight_baseline(reaches)
    states = scene_states([reach.path for reach in reaches], baseline, parameters.keep_every)
    ensemble = parameters.network
    displaced = [displaced_states(states, ensemble, (number, member)) for member in range(ensemble.members)]
    nearest, *near = (samples_of_nearest(moved, scenes) for moved in (states, *displaced))
    scene, *far = (samples_of_scene(moved, scenes) for moved in (states, *displaced))
    signs = mirror_signs()
    every_near, *near = (with_mirror_images(samples, MIRROR_SIGNS) for samples in (nearest, *near))
    every_far, *far = (with_mirror_images(samples, signs) for samples in (scene, *far))
    networks: dict[str, TrainingSets] = {
        PUBLISHED: (parameters.published_network, nearest, [nearest]),
        NEAREST: (ensemble, every_near, near),
        SCENE: (ensemble, every_far, far),
    }
    return baseline, nearest, networks


def reach_through(
    learned: SceneModels, kind: str, scenes: Scenes, parameters: SceneLearningParameters
) -> tuple[np.ndarray, np.ndarray]:
    """Paths (B, T, 3) m, base frame, of a model, `NONE` or `PLANNED`; distances (B,) m left to the goal."""
    samples = parameters.reaches.samples
    if kind == PLANNED:
        path = np.array([planned_path(scenes, place, samples) for place in range(len(scenes))])
    else:
        feedback = None if kind == NONE else _feedback(learned.models[kind], kind, scenes, parameters)
        limits = (END_LIMIT_M, RETURN_COUPLING) if kind == SCENE else ()
        unrolled: Trajectory = unroll_through(learned.baseline, scenes.goal, feedback, samples, *limits)
        path = scenes.start[:, None] + unrolled.position @ np.swapaxes(scenes.frame, 1, 2)
    goal = scenes.start + np.einsum("bij,bj->bi", scenes.frame, scenes.goal)
    return path, np.linalg.norm(path[:, -1] - goal, axis=1)


def planned_path(scenes: Scenes, place: int, samples: int) -> np.ndarray:
    """Minimum-jerk motion (T, 3) m along the planned path of a scene, base frame; linear in height."""
    start = scenes.start[place]
    goal = start + scenes.frame[place] @ scenes.goal[place]
    ahead = np.arange(PLANNED_STEP_M, PLANNED_MOST_M, PLANNED_STEP_M)
    path = np.vstack([start[:2], scenes.costs_to_go[place].paths(start[None, :2], ahead)[0]])
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    share = minimum_jerk(np.linspace(0.0, 1.0, samples))
    x, y = (np.interp(share * length[-1], length, column) for column in path.T)
    return np.column_stack([x, y, start[2] + share * (goal[2] - start[2])])


Feedback = Callable[[int, np.ndarray, np.ndarray], np.ndarray]
"""(sample, position (B, 3) m, tau v (B, 3) m) -> coupling term (B, 3) m."""


def _feedback(
    model: CouplingModel, kind: str, scenes: Scenes, parameters: SceneLearningParameters
) -> Feedback:
    """Coupling term of a model, from the scene or from the nearest obstacle with the published rules."""
    phase = canonical.phase(np.linspace(0.0, 1.0, parameters.reaches.samples), TAU)

    def at(k: int, position: np.ndarray, scaled_velocity: np.ndarray) -> np.ndarray:
        now = [np.full(len(position), values[k]) for values in phase]
        if kind == SCENE:
            states = enumerate(zip(position[:, None], scaled_velocity[:, None], strict=True))
            return model(np.concatenate([scenes.features(b, *state) for b, state in states]), *now)
        seen, x = nearest_seen(position, scaled_velocity, scenes.clouds)
        bounds = (x.min(axis=1), x.max(axis=1), scenes.goal[:, 0])
        return post_processed(model(seen, *now), position[:, 0], *bounds, TEXT_DECAY_PER_M2)

    return at


def unroll_through(
    primitive: VectorPrimitive,
    goals: np.ndarray,
    feedback: Feedback | None,
    samples: int,
    end_limit_m: float | None = None,
    return_coupling: float = 0.0,
) -> Trajectory:
    """Unroll a primitive of duration 1 from the origin to B goals (B, 3) m in local frames, T samples.

    As in `avoiding_unroll`, feedback begins at the second sample. `end_limit_m` and `return_coupling` limit
    the deviation that may remain at the end (`GoalReach`). Returns (B, T, 3) positions relative to the start,
    velocities and accelerations per duration.
    """
    time = np.linspace(0.0, 1.0, samples)
    forcing = primitive.forcing(time, np.zeros((len(goals), 1, 3)), goals[:, None], 1.0)
    deadlines = [] if end_limit_m is None else [Deadline(samples - 1, end_limit_m)]
    reach = GoalReach(goals.shape, time[1] / TAU, deadlines, return_coupling)

    def coupling(k: int, x: np.ndarray, xd: np.ndarray) -> np.ndarray:
        if k == 0 or feedback is None:
            return np.zeros(goals.shape)
        wanted = feedback(k, x, TAU * xd)
        acts = reach.admissible(k, wanted) if deadlines else wanted
        reach.advance(acts)
        return acts

    state = (primitive.velocity, primitive.acceleration)
    return transformation.unroll(np.zeros(goals.shape), goals, forcing, time[1], TAU, *state, coupling)
