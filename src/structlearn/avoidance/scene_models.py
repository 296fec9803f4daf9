"""What is learned from some people's reaches through scenes, and what all of it does in others' scenes.

Members of the ensemble see every sample from elsewhere too, as in `network_training`, or the loop is only as
good as its hand keeps to a path that was shown. With the coupling of the demonstration the displacement dies
out as the primitive's own attraction lets it; where gaps are narrow that is too slow, so what is learned
there leads back by a stiffness more:

    c(x + dx, v + dv) = c(x, v) - k dx
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from structlearn.avoidance.avoidance_dataset import AvoidanceDataset, concatenated
from structlearn.avoidance.avoidance_network import averaged
from structlearn.avoidance.features import MIRROR, MIRROR_SIGNS, CouplingModel
from structlearn.avoidance.levenberg_marquardt import LESSON
from structlearn.avoidance.look_ahead import cost_to_go, mirror_signs, scene_features
from structlearn.avoidance.network_training import (
    EnsembleParameters,
    NetworkParameters,
    stacked,
    train_member,
)
from structlearn.avoidance.rai_2014 import fit_human_inspired
from structlearn.avoidance.scene_unroll import (
    TAU,
    SceneLearningParameters,
    SceneReach,
    Scenes,
    feedback_of_nearest,
    feedback_of_scene,
    local_clouds,
    nearest_seen,
    unroll_through,
)
from structlearn.core.minimum_jerk import progress
from structlearn.core.parallel import parallel_map
from structlearn.feedback.coupling import position_target
from structlearn.primitives import canonical
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
    return SceneStates(
        **{name: np.concatenate([vars(one)[name] for one in parts]) for name in vars(parts[0])}
    )


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
    return SceneStates(
        **{name: np.concatenate([values, vars(beside)[name]]) for name, values in vars(seen).items()}
    )


def samples_of_scene(states: SceneStates, scenes: Scenes, ahead: Sequence[float]) -> AvoidanceDataset:
    """The states with the features of their scenes (`look_ahead.scene_features`)."""
    columns = [
        scene_features(
            scenes.ways[b],
            states.position[rows],
            states.scaled_velocity[rows],
            scenes.start[b],
            scenes.frame[b],
            scenes.goal[b],
            ahead,
        )
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
        columns.append(nearest_seen(states.position[rows], states.scaled_velocity[rows], clouds).features)
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
            cost_to_go(reach.shapes, reach.start, goal, parameters.look_ahead)
            for reach, goal in zip(reaches, goals, strict=True)
        ],
    )


def straight_baseline(reaches: Sequence[SceneReach], straight_share: float) -> VectorPrimitive:
    """The primitive of reaches that hardly leave the straight line, or of the straightest where all do.

    Its forcing grows with their length.
    """
    away = [np.linalg.norm(reach.path.position[:, 1:], axis=1).max() / reach.goal[0] for reach in reaches]
    most = max(straight_share, min(away))
    straight = [reach.path for reach, its in zip(reaches, away, strict=True) if its <= most]
    return fit_position(straight, scaled=(True, False, False)).local


def learn(
    reaches: Sequence[SceneReach],
    scenes: Scenes,
    parts: Sequence[Sequence[int]],
    parameters: SceneLearningParameters,
) -> list[Learned]:
    """Learn from each of some sets of reaches.

    Returns what was learned of each set.
    """
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
