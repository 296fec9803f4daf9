"""What is learned from some people's reaches through scenes, and what it does in others' scenes (IV.8.4).

Members of the ensemble see every sample from elsewhere too, as in `network_training`, or the loop is only as
good as its hand keeps to a path that was shown. With the coupling of the demonstration the displacement dies
out as the primitive's own attraction lets it; where gaps are narrow that is too slow, so what is learned
there leads back by a stiffness more:

    c(x + dx, v + dv) = c(x, v) - k dx
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from structlearn.avoidance.avoidance_dataset import AvoidanceDataset, concatenated
from structlearn.avoidance.avoidance_network import averaged
from structlearn.avoidance.features import MIRROR, MIRROR_SIGNS, CouplingModel, features
from structlearn.avoidance.levenberg_marquardt import LESSON
from structlearn.avoidance.look_ahead import CostToGo, cost_to_go, mirror_signs, scene_features
from structlearn.avoidance.network_training import (
    EnsembleParameters,
    NetworkParameters,
    stacked,
    train_member,
)
from structlearn.avoidance.postprocessing import Deadline, GoalReach, post_processed
from structlearn.avoidance.rai_2014 import fit_human_inspired
from structlearn.avoidance.scene_reaches import SceneLearningParameters, SceneReach
from structlearn.avoidance.shapes import Obstacle
from structlearn.core.minimum_jerk import progress
from structlearn.core.parallel import parallel_map
from structlearn.feedback.coupling import position_target
from structlearn.primitives import canonical, transformation
from structlearn.primitives.position import fit_position
from structlearn.primitives.trajectory import Trajectory
from structlearn.primitives.vector import VectorPrimitive

NONE, HUMAN_INSPIRED, TEXT, ENSEMBLE, SCENE, PLANNED = (
    "none",
    "human_inspired",
    "text",
    "text_ensemble",
    "scene",
    "planned",
)
"""The baseline alone; Rai et al.; the text's features with the text's network; the same features with our
training; the scene's features with the same network and training; the planned way itself."""

PLANNED_STEP_M = 0.005
PLANNED_MOST_M = 2.0  # spacing and greatest length of a planned way


TAU = canonical.time_constant(1.0)  # time constant in durations


@dataclass(frozen=True)
class Scenes:
    """B scenes as models see them."""

    start: np.ndarray  # (B, 3) m, base frame
    frame: np.ndarray  # (B, 3, 3) local to base
    goal: np.ndarray  # (B, 3) m, local frame
    # (B, O, P, 3) m, local frame, surfaces of the obstacles; a scene with fewer has one repeatedly
    clouds: np.ndarray
    ways: Sequence[CostToGo]  # of each scene

    def __len__(self) -> int:
        return len(self.start)

    def take(self, places: Sequence[int]) -> Self:
        """Some of the scenes, in their order and as often as named."""
        arrays = (self.start[places], self.frame[places], self.goal[places], self.clouds[places])
        return type(self)(*arrays, [self.ways[place] for place in places])

    def features(
        self, scene: int, position: np.ndarray, scaled_velocity: np.ndarray, ahead: Sequence[float]
    ) -> np.ndarray:
        """`look_ahead.scene_features` of states (N, 3), (N, 3) in one of the scenes."""
        place = (self.start[scene], self.frame[scene], self.goal[scene])
        return scene_features(self.ways[scene], position, scaled_velocity, *place, ahead)


@dataclass(frozen=True)
class SceneStates:
    """Samples of reaches, each through its own scene."""

    scene: np.ndarray  # (S,) place of its scene among `Scenes`
    time: np.ndarray  # (S,) in durations
    position: np.ndarray  # (S, 3) m, local frame, relative to the start
    scaled_velocity: np.ndarray  # (S, 3) tau v, m
    target: np.ndarray  # (S, 3) m, coupling term

    def where(self, mask: np.ndarray) -> Self:
        """The samples of a mask (S,) or of indices."""
        return type(self)(**{name: values[mask] for name, values in vars(self).items()})


def scene_states(paths: Sequence[Trajectory], baseline: VectorPrimitive, keep_every: int) -> SceneStates:
    """States of reaches, and their coupling targets (eq. IV.23).

    `paths` (T, 3) in their local frames, relative to the start, time in durations; that of scene b at b;
    `keep_every`: of the samples.
    """
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
    return concatenated(parts)


def displaced_states(
    states: SceneStates, parameters: EnsembleParameters, stiffness: float, stream: Sequence[int]
) -> SceneStates:
    """What one member of an ensemble sees: some reaches, each sample as it was and once from elsewhere.

    `parameters`: how many reaches, how far and how fast elsewhere; `stream`: which random numbers are the
    member's own.
    """
    rng = np.random.default_rng([parameters.training.seed, *stream, LESSON])
    chosen = rng.permutation(np.unique(states.scene))[: parameters.demonstrations]
    seen = states.where(np.isin(states.scene, chosen))
    off, faster = rng.standard_normal((2, len(seen.time), 3))
    off, faster = parameters.displaced_m * off, parameters.displaced_velocity_m * faster
    beside = replace(
        seen,
        position=seen.position + off,
        scaled_velocity=seen.scaled_velocity + faster,
        target=seen.target - stiffness * off,
    )
    return concatenated([seen, beside])


def samples_of_scene(states: SceneStates, scenes: Scenes, ahead: Sequence[float]) -> AvoidanceDataset:
    """The states with the features of their scenes (`look_ahead.scene_features`)."""
    columns = [
        scenes.features(b, states.position[rows], states.scaled_velocity[rows], ahead)
        for b, rows in _rows_by_scene(states)
    ]
    return _dataset(states, columns)


def with_mirror_images(dataset: AvoidanceDataset, signs: np.ndarray) -> AvoidanceDataset:
    """The samples, and each once more as it is in the mirror: left and right are alike to a point.

    `signs` (F,) of its features: `look_ahead.mirror_signs` or `features.MIRROR_SIGNS`.
    """
    image = replace(dataset, features=dataset.features * signs, target=dataset.target * MIRROR)
    return concatenated([dataset, image])


def samples_of_nearest(states: SceneStates, scenes: Scenes) -> AvoidanceDataset:
    """The states with the text's features of the obstacle that is nearest at each of them."""
    columns = []
    for b, rows in _rows_by_scene(states):
        clouds = np.broadcast_to(scenes.clouds[b], (len(rows), *scenes.clouds[b].shape))
        columns.append(nearest_seen(states.position[rows], states.scaled_velocity[rows], clouds)[0])
    return _dataset(states, columns)


def _rows_by_scene(states: SceneStates) -> list[tuple[int, np.ndarray]]:
    return [(int(b), np.flatnonzero(states.scene == b)) for b in np.unique(states.scene)]


def _dataset(states: SceneStates, columns: Sequence[np.ndarray]) -> AvoidanceDataset:
    """Samples in the order of the states, from features of each scene in turn."""
    order = np.concatenate([rows for _, rows in _rows_by_scene(states)])
    features = np.empty((len(order), columns[0].shape[1]))
    features[order] = np.concatenate(columns)
    p, u = canonical.phase(states.time, TAU)
    none = np.zeros(len(order), dtype=int)
    return AvoidanceDataset(features, states.target, p, u, none, states.scene, states.time)


def nearest_seen(
    position: np.ndarray, scaled_velocity: np.ndarray, clouds: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The text's features of the obstacle whose surface is nearest to the hand.

    `position` (B, 3) m; `scaled_velocity` (B, 3) tau v, m; `clouds` (B, O, P, 3) m. Returns (B, 17) features,
    and (B, P) x of that obstacle's points in m.
    """
    every = features(position[:, None], scaled_velocity[:, None], 1.0, clouds, clouds.mean(axis=2))
    nearest = np.linalg.norm(every[..., [3, 6, 9]], axis=-1).argmin(axis=1)
    rows = np.arange(len(position))
    return every[rows, nearest], clouds[rows, nearest, :, 0]


@dataclass(frozen=True)
class Learned:
    """What was learned from some people."""

    baseline: VectorPrimitive  # without obstacles, of duration one
    models: Mapping[str, CouplingModel]  # coupling models by name


def reach_scenes(reaches: Sequence[SceneReach], parameters: SceneLearningParameters) -> Scenes:
    """The scenes of reaches as models see them."""
    start, frame = (np.array([getattr(reach, name) for reach in reaches]) for name in ("start", "frame"))
    goals = [reach.in_base_frame[-1] for reach in reaches]
    return Scenes(
        start=start,
        frame=frame,
        goal=np.array([reach.goal for reach in reaches]),
        clouds=local_clouds([reach.obstacles for reach in reaches], start, frame, parameters.cloud_count),
        ways=[
            cost_to_go([*reach.obstacles, *reach.walls], reach.start, goal, parameters.look_ahead)
            for reach, goal in zip(reaches, goals, strict=True)
        ],
    )


def local_clouds(
    obstacles: Sequence[Sequence[Obstacle]], start: np.ndarray, frame: np.ndarray, count: int
) -> np.ndarray:
    """Surfaces of the obstacles of B scenes in their local frames, `Scenes.clouds`.

    `obstacles`: of each scene, at least one; `start` (B, 3) m, base frame; `frame` (B, 3, 3) local to base.
    """
    most = max(map(len, obstacles))
    clouds = [
        [(one.cloud(count) - origin) @ axes for one in (*its, *[its[0]] * (most - len(its)))]
        for its, origin, axes in zip(obstacles, start, frame, strict=True)
    ]
    return np.array(clouds)


def straight_baseline(reaches: Sequence[SceneReach], straight_share: float) -> VectorPrimitive:
    """The primitive of reaches that hardly leave the straight line, or of the straightest where all do.

    Its forcing grows with their length.
    """
    most = max(straight_share, min(reach.bend for reach in reaches))
    straight = [reach.path for reach in reaches if reach.bend <= most]
    return fit_position(straight, scaled=(True, False, False)).local


def learn(
    reaches: Sequence[SceneReach],
    scenes: Scenes,
    parts: Sequence[Sequence[int]],
    parameters: SceneLearningParameters,
) -> list[Learned]:
    """What is learned from each of some sets of reaches."""
    taught = [
        _lessons([reaches[place] for place in places], scenes.take(places), number, parameters)
        for number, places in enumerate(parts)
    ]
    work = [
        (whole, network, (number, member), seen)
        for number, one in enumerate(taught)
        for network, whole, lessons in one.networks.values()
        for member, seen in enumerate(lessons)
    ]
    layers = iter(parallel_map(_trained, work, "networks of reaches through scenes"))
    learned = []
    for one in taught:
        models: dict[str, CouplingModel] = {
            HUMAN_INSPIRED: fit_human_inspired(one.nearest.features, one.nearest.target)
        }
        for kind, (network, whole, lessons) in one.networks.items():
            members = averaged([next(layers) for _ in lessons])
            models[kind] = stacked([members], [whole], network)
        learned.append(Learned(one.baseline, models))
    return learned


@dataclass(frozen=True)
class _Lessons:
    """What there is to learn of one set."""

    baseline: VectorPrimitive  # of the set
    nearest: AvoidanceDataset  # samples with the text's features
    # by kind, how it is trained, all of its samples, and what each member sees of them
    networks: Mapping[str, tuple[NetworkParameters, AvoidanceDataset, Sequence[AvoidanceDataset]]]


def _lessons(
    reaches: Sequence[SceneReach], scenes: Scenes, number: int, parameters: SceneLearningParameters
) -> _Lessons:
    """Of the set of some number."""
    baseline = straight_baseline(reaches, parameters.straight_share)
    states = scene_states([one.path for one in reaches], baseline, parameters.keep_every)
    ensemble, ahead = parameters.network, parameters.look_ahead.ahead_m
    beside = [
        displaced_states(states, ensemble, parameters.return_stiffness, (number, member))
        for member in range(ensemble.members)
    ]
    nearest, *near = (samples_of_nearest(one, scenes) for one in (states, *beside))
    scene, *far = (samples_of_scene(one, scenes, ahead) for one in (states, *beside))
    signs = mirror_signs(parameters.look_ahead)
    every_near, *near = (with_mirror_images(one, MIRROR_SIGNS) for one in (nearest, *near))
    every_far, *far = (with_mirror_images(one, signs) for one in (scene, *far))
    networks = {
        TEXT: (parameters.text_network, nearest, [nearest]),
        ENSEMBLE: (ensemble, every_near, near),
        SCENE: (ensemble, every_far, far),
    }
    return _Lessons(baseline, nearest, networks)


def _trained(
    work: tuple[AvoidanceDataset, NetworkParameters, tuple[int, int], AvoidanceDataset],
) -> tuple[np.ndarray, ...]:
    return train_member(*work)


def reach_through(
    learned: Learned, kind: str, scenes: Scenes, parameters: SceneLearningParameters
) -> tuple[np.ndarray, np.ndarray]:
    """Reaches of one model through scenes.

    `kind`: of the model, or `NONE` or `PLANNED`; `scenes`: B of them. Returns `path` (B, T, 3) m, base frame;
    `left` (B,) m, distance from the goal at the prescribed end.
    """
    samples = parameters.reaches.samples
    if kind == PLANNED:
        path = np.array([planned_path(scenes, place, samples) for place in range(len(scenes))])
    else:
        limit: dict[str, float] = {}
        if kind == NONE:
            feedback = None
        elif kind == SCENE:
            ahead = parameters.look_ahead.ahead_m
            feedback = feedback_of_scene(learned.models[kind], scenes, samples, ahead)
            limit = {"end_limit_m": parameters.end_limit_m, "return_coupling": parameters.return_coupling}
        else:
            decay = parameters.text_decay_per_m2
            feedback = feedback_of_nearest(learned.models[kind], scenes, samples, decay)
        unrolled: Trajectory = unroll_through(learned.baseline, scenes.goal, feedback, samples, **limit)
        path = scenes.start[:, None] + unrolled.position @ np.swapaxes(scenes.frame, 1, 2)
    goal = scenes.start + np.einsum("bij,bj->bi", scenes.frame, scenes.goal)
    return path, np.linalg.norm(path[:, -1] - goal, axis=1)


def planned_path(scenes: Scenes, place: int, samples: int) -> np.ndarray:
    """The planned way of one scene followed with least jerk, (T, 3) m, base frame; straight in height."""
    start = scenes.start[place]
    goal = start + scenes.frame[place] @ scenes.goal[place]
    ahead = np.arange(PLANNED_STEP_M, PLANNED_MOST_M, PLANNED_STEP_M)
    way = np.vstack([start[:2], scenes.ways[place].ways(start[None, :2], ahead)[0]])
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1)))
    share = progress(np.linspace(0.0, 1.0, samples))
    x, y = (np.interp(share * length[-1], length, column) for column in way.T)
    return np.column_stack([x, y, start[2] + share * (goal[2] - start[2])])


Feedback = Callable[[int, np.ndarray, np.ndarray], np.ndarray]
"""Sample, position (B, 3) m, tau v (B, 3) m -> coupling term (B, 3) m."""


def feedback_of_nearest(model: CouplingModel, scenes: Scenes, samples: int, decay_per_m2: float) -> Feedback:
    """A model of the text's features, with the text's post-processing, for the nearest obstacle.

    `model`: of features, phase and phase velocity; `scenes`: B of them; `decay_per_m2`: k past the obstacle
    (`postprocessing`).
    """
    phase = phases(samples)

    def at(k: int, position: np.ndarray, scaled_velocity: np.ndarray) -> np.ndarray:
        seen, x = nearest_seen(position, scaled_velocity, scenes.clouds)
        wanted = model(seen, *(np.full(len(position), values[k]) for values in phase))
        bounds = (x.min(axis=1), x.max(axis=1), scenes.goal[:, 0])
        return post_processed(wanted, position[:, 0], *bounds, decay_per_m2)

    return at


def feedback_of_scene(model: CouplingModel, scenes: Scenes, samples: int, ahead: Sequence[float]) -> Feedback:
    """A model of the scene's features; arguments as `feedback_of_nearest`, `ahead` as `scene_features`."""
    phase = phases(samples)

    def at(k: int, position: np.ndarray, scaled_velocity: np.ndarray) -> np.ndarray:
        rows = [
            scenes.features(b, position[b : b + 1], scaled_velocity[b : b + 1], ahead)
            for b in range(len(position))
        ]
        return model(np.concatenate(rows), *(np.full(len(position), values[k]) for values in phase))

    return at


def phases(samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Phase and phase velocity (T,) of a movement of so many samples."""
    return canonical.phase(np.linspace(0.0, 1.0, samples), TAU)


def unroll_through(
    primitive: VectorPrimitive,
    goals: np.ndarray,
    feedback: Feedback | None,
    samples: int,
    end_limit_m: float | None = None,
    return_coupling: float = 0.0,
) -> Trajectory:
    """Unroll a primitive of duration one from the origin to B goals.

    As in `avoiding_unroll` the feedback begins with the second sample. `primitive`: in the local frame;
    `goals` (B, 3) m, local frame; `feedback`: None for the primitive alone; `samples`: T, from the start to
    the prescribed end; `end_limit_m`, `return_coupling`: how far off the primitive's own end feedback may
    leave the hand, and the coupling term that is trusted to bring it back (`GoalReach`). Returns (B, T, 3)
    positions relative to the start, velocities and accelerations per duration.
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
