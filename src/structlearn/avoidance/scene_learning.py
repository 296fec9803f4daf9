"""What a network learns of scenes: states of people's reaches, and states beside them.

Members of the ensemble see every sample from elsewhere too, as in `network_training`, or the loop is only as
good as its hand keeps to a path that was shown. With the coupling of the demonstration the displacement dies
out as the primitive's own attraction lets it; where gaps are narrow that is too slow, so what is learned
there leads back by a stiffness more:

    c(x + dx, v + dv) = c(x, v) - k dx
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from structlearn.avoidance.avoidance_dataset import AvoidanceDataset, concatenated
from structlearn.avoidance.features import MIRROR
from structlearn.avoidance.levenberg_marquardt import LESSON
from structlearn.avoidance.look_ahead import scene_features
from structlearn.avoidance.network_training import EnsembleParameters
from structlearn.avoidance.scene_unroll import TAU, Scenes, nearest_seen
from structlearn.feedback.coupling import position_target
from structlearn.primitives import canonical
from structlearn.primitives.trajectory import Trajectory
from structlearn.primitives.vector import VectorPrimitive


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
    """States of reaches, and the coupling terms that they ask for (eq. IV.23).

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
