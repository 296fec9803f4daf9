"""Learning from a task's reaches past obstacles, tested in scenes held out (IV.8)."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, combinations
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.avoidance import scene_models
from structlearn.avoidance.avoidance_dataset import AXES
from structlearn.avoidance.look_ahead import nearest_distance
from structlearn.avoidance.scene_models import HUMAN_INSPIRED, NEAREST, NONE, PLANNED, PUBLISHED, SCENE
from structlearn.avoidance.scene_reaches import SceneLearningParameters, SceneReach, reaches_past_obstacles
from structlearn.core.errors import MissingInputError
from structlearn.readers.demonstration import Demonstration
from structlearn.tasks.obstacles.parameters import ObstacleParameters
from structlearn.tasks.task_files import TaskFiles, write_tables

MODELS = (HUMAN_INSPIRED, PUBLISHED, NEAREST, SCENE)

ALL_MODELS = (NONE, *MODELS, PLANNED)  # in the order of tables

SAME_END_M = 0.1  # largest distance between starts, and between goals, of reaches through one scene

SHOWN = 6  # number of reaches in pictures and recordings


def learn(files: TaskFiles, folder: Path) -> None:
    """Write the tables of `SceneResults`."""
    results = learn_past_obstacles(files.runs("reaches"), files.entry(ObstacleParameters))
    write_tables(vars(results), folder)


@dataclass(frozen=True)
class SceneResults:
    """Result tables over all folds."""

    # per `model` of `ALL_MODELS` and `reach`: `person`, `fold`; `blocked`: the straight line hits an
    # obstacle; `hit`, `hit_wall`: it hits an obstacle, a wall; `clearance_mm` of the hand's centre from
    # the nearest obstacle, `left_mm` to the goal at the prescribed end, `path_mm` from the person's own path,
    # and `same_gaps`: it takes the same gaps as the person
    reaches: pd.DataFrame
    # per `model` of `MODELS`, `fold` and `axis`, sums over held-out samples: `squared` errors of the coupling
    # term, and `variance`, squared deviations of the targets from their mean
    errors: pd.DataFrame
    # per pair of people who reached through the same scene: `first`, `second`, `reach`, `path_mm`,
    # `same_gaps`
    people: pd.DataFrame
    left_out: pd.DataFrame  # trials that are not reaches: `trial`, `person`, `reason`
    # some reaches for pictures: `reach`, `model` (or `recorded`), `time_s`, `x_m`, `y_m`, `z_m`
    paths: pd.DataFrame
    # shapes of these reaches: `reach`, `box` (obstacle, not wall), centre `x_m`, `y_m`, `z_m` and extent
    # `width_m`, `depth_m`, `height_m`
    shapes: pd.DataFrame


def learn_past_obstacles(runs: Sequence[Demonstration], parameters: SceneLearningParameters) -> SceneResults:
    """Cut the reaches, learn fold by fold, and test on the held-out people.

    Raises InputError: as `reaches_past_obstacles`. Raises MissingInputError: too few people.
    """
    reaches, left_out = reaches_past_obstacles(runs, parameters)
    return judge_folds(reaches, left_out, folds_of_people(reaches, parameters), parameters)


def folds_of_people(reaches: Sequence[SceneReach], parameters: SceneLearningParameters) -> list[list[str]]:
    """Folds of the people on whom nothing was tuned; at most one fold per person.

    If all people are tested, they are sorted by the bend of their straightest reach before they are dealt
    out, so that every training set has straight reaches for the baseline; otherwise by name, since people in
    all training sets have such reaches. Raises MissingInputError: nobody to test, or nobody else to learn
    from.
    """
    bends: dict[str, float] = {}
    for reach in reaches:
        bends[reach.person] = min(reach.bend, bends.get(reach.person, np.inf))
    people = sorted(bends) if parameters.tuned_on else sorted(bends, key=bends.__getitem__)
    judged = [person for person in people if person not in parameters.tuned_on]
    if not judged or len(people) < 2:
        raise MissingInputError(
            f"reaches of {len(people)} people, {len(judged)} of them on whom nothing was chosen: one is "
            "needed to be judged, and another person to learn from"
        )
    count = min(parameters.folds, len(judged))
    return [judged[number::count] for number in range(count)]


def judge_folds(
    reaches: Sequence[SceneReach],
    left_out: pd.DataFrame,
    folds: Sequence[Sequence[str]],
    parameters: SceneLearningParameters,
) -> SceneResults:
    """For each fold, learn from all other people and test on the people of the fold."""
    scenes = scene_models.reach_scenes(reaches, parameters)
    person = np.array([reach.person for reach in reaches])
    tests = [np.flatnonzero(np.isin(person, people)).tolist() for people in folds]
    training_parts = [np.flatnonzero(~np.isin(person, people)).tolist() for people in folds]
    scored, errors = [], []
    unrolled: dict[tuple[str, str], np.ndarray] = {}
    for fold, learned in enumerate(
        scene_models.learn_scene_models(reaches, scenes, training_parts, parameters)
    ):
        own, tested = [reaches[place] for place in tests[fold]], scenes.take(tests[fold])
        errors.append(_errors(learned, own, tested, parameters).assign(fold=fold))
        for model in ALL_MODELS:
            paths, left = scene_models.reach_through(learned, model, tested, parameters)
            unrolled |= {(own[place].name, model): path for place, path in enumerate(paths)}
            scored.append(
                reach_scores(own, paths, left, parameters.hand_radius_m).assign(model=model, fold=fold)
            )
    table = pd.concat(scored, ignore_index=True)
    shown = pictured_reaches(table)
    return SceneResults(
        reaches=table,
        errors=pd.concat(errors, ignore_index=True),
        people=beside_each_other(reaches),
        left_out=left_out,
        **_pictures([reach for reach in reaches if reach.name in shown], unrolled),
    )


def reach_scores(
    reaches: Sequence[SceneReach], paths: np.ndarray, left: np.ndarray, hand_radius_m: float
) -> pd.DataFrame:
    """Rows of `SceneResults.reaches` for paths (B, T, 3) m in the base frame."""
    rows = []
    for reach, path, left_m in zip(reaches, paths, left, strict=True):
        own = reach.in_base_frame
        straight = own[0] + np.linspace(0.0, 1.0, len(own))[:, None] * (own[-1] - own[0])
        meetings = ((reach.obstacles, straight), (reach.obstacles, path), (reach.walls, path))
        clearances = [float(nearest_distance(shapes, points).min()) for shapes, points in meetings]
        touches = [clearance < hand_radius_m for clearance in clearances]
        lengths = (1e3 * clearances[1], 1e3 * left_m)
        rows.append((reach.name, reach.person, *touches, *lengths, *_beside(reach, path, own)))
    measures = ["blocked", "hit", "hit_wall", "clearance_mm", "left_mm", "path_mm", "same_gaps"]
    return pd.DataFrame(rows, columns=["reach", "person", *measures])


def _beside(reach: SceneReach, path: np.ndarray, other: np.ndarray) -> tuple[float, bool]:
    """Distance in mm between two paths (T, 3) m through one scene, and whether they take the same gaps."""
    centres = [obstacle.centre[:2] for obstacle in reach.obstacles]
    return 1e3 * nearest_path_distance(path, other), same_gaps(path[:, :2], other[:, :2], centres)


def _errors(
    learned: scene_models.SceneModels,
    reaches: Sequence[SceneReach],
    scenes: scene_models.Scenes,
    parameters: SceneLearningParameters,
) -> pd.DataFrame:
    """Rows of `SceneResults.errors` on held-out reaches."""
    paths = [reach.path for reach in reaches]
    states = scene_models.scene_states(paths, learned.baseline, parameters.keep_every)
    nearest = scene_models.samples_of_nearest(states, scenes)
    seen = scene_models.samples_of_scene(states, scenes)
    variance = np.square(states.target - states.target.mean(axis=0)).sum(axis=0)
    rows = []
    for model in MODELS:
        samples = seen if model == SCENE else nearest
        predicted = learned.models[model](samples.features, samples.phase, samples.phase_velocity)
        squared = np.square(predicted - states.target).sum(axis=0)
        rows += list(zip([model] * 3, AXES, squared, variance, strict=True))
    return pd.DataFrame(rows, columns=["model", "axis", "squared", "variance"])


def beside_each_other(reaches: Sequence[SceneReach]) -> pd.DataFrame:
    """Rows of `SceneResults.people`: pairs of people's reaches through the same obstacles."""
    groups: dict[bytes, list[SceneReach]] = {}
    for reach in reaches:
        solids = np.round([[*obstacle.centre, *obstacle.half_size] for obstacle in reach.obstacles], 3)
        groups.setdefault(solids[np.lexsort(solids.T)].tobytes(), []).append(reach)
    rows = []
    for first, second in chain.from_iterable(combinations(together, 2) for together in groups.values()):
        apart = np.subtract(first.in_base_frame[[0, -1]], second.in_base_frame[[0, -1]])
        if first.person != second.person and (np.linalg.norm(apart, axis=1) < SAME_END_M).all():
            pair = (first.person, second.person, second.name)
            rows.append((*pair, *_beside(second, first.in_base_frame, second.in_base_frame)))
    return pd.DataFrame(rows, columns=["first", "second", "reach", "path_mm", "same_gaps"])


def pictured_reaches(table: pd.DataFrame) -> list[str]:
    """Reaches for pictures, chosen by the scene alone: evenly spaced among the blocked ones."""
    blocked = (
        table.loc[(table["model"] == NONE) & table["blocked"], "reach"].sort_values(kind="stable").tolist()
    )
    count = min(SHOWN, len(blocked))
    return [blocked[(2 * place + 1) * len(blocked) // (2 * count)] for place in range(count)]


def _pictures(
    reaches: Sequence[SceneReach], unrolled: dict[tuple[str, str], np.ndarray]
) -> dict[str, pd.DataFrame]:
    """`SceneResults.paths` and `shapes` of some reaches."""
    paths, shapes = [], []
    for reach in reaches:
        drawn = {"recorded": reach.in_base_frame} | {
            model: unrolled[reach.name, model] for model in ALL_MODELS
        }
        for model, path in drawn.items():
            columns = dict(zip(("x_m", "y_m", "z_m"), path.T, strict=True))
            time = reach.duration_s * reach.path.time
            paths.append(pd.DataFrame({"reach": reach.name, "model": model, "time_s": time, **columns}))
        kinds = [(True, obstacle) for obstacle in reach.obstacles] + [(False, wall) for wall in reach.walls]
        shapes += [(reach.name, box, *solid.centre, *2.0 * solid.half_size) for box, solid in kinds]
    names = ["reach", "box", "x_m", "y_m", "z_m", "width_m", "depth_m", "height_m"]
    none = pd.DataFrame(columns=["reach", "model", "time_s", "x_m", "y_m", "z_m"])
    return {
        "paths": pd.concat(paths, ignore_index=True) if paths else none,
        "shapes": pd.DataFrame(shapes, columns=names),
    }


def nearest_path_distance(first: np.ndarray, second: np.ndarray) -> float:
    """Symmetric mean distance in m of two paths (T, D), (S, D) m: mean distance to the nearest point."""
    distances = np.linalg.norm(first[:, None] - second[None], axis=-1)
    return float(0.5 * (distances.min(axis=0).mean() + distances.min(axis=1).mean()))


def same_gaps(first: np.ndarray, second: np.ndarray, centres: Sequence[np.ndarray]) -> bool:
    """Whether two paths (T, 2), (S, 2) with equal ends pass every centre (2,) on the same side.

    They do if the closed curve along one and back along the other does not wind around any centre: one path
    can then be deformed into the other without crossing a centre.
    """
    loop = np.vstack([first, second[::-1], first[:1]])
    for centre in centres:
        angle = np.arctan2(*(loop - centre).T[::-1])
        turns = (np.diff(angle) + np.pi) % (2.0 * np.pi) - np.pi
        if round(float(turns.sum()) / (2.0 * np.pi)):
            return False
    return True
