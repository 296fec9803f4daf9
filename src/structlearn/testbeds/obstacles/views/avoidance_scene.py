"""The obstacle testbed in recordings: solids and their clouds, hands that reach past them, coupling terms.

Everything is in the base frame. No robot is shown: the hand is a point, as motion capture sees it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import rerun as rr
from pydantic import Field
from rerun.components import FillMode

from structlearn.avoidance.avoidance_dataset import baseline_axes
from structlearn.avoidance.shapes import Obstacle
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.primitives.position import PositionPrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.testbeds.obstacles.names import DEMONSTRATIONS, FREE, HIT, SOURCES
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import TRAINED
from structlearn.testbeds.obstacles.protocol.unrolled_reaches import (
    Group,
    Reach,
    SituationKey,
    without_avoidance,
)
from structlearn.testbeds.obstacles.world.scenarios import Scenario
from structlearn.viewer.rrd import entity, rgba, send_moving_frame, time_column

BARE = SOURCES[""]  # look of the reach without avoidance
PALE = 0.5  # opacity of demonstrations, of which there are many, and of paths before they come about
SOLID_OPACITY = 0.35  # of obstacles: the cloud on the far side stays visible
ARROW_SCALE = 1.5e-3  # length of an arrow per coupling term, m per m: those of networks are up to 0.15 m long

LONGEST_ARROW_M = 0.15
"""Of longer ones the direction is drawn: the model of Rai et al. asks for up to 100 times as much."""

ARROW_EVERY = 2  # every how many samples of a path an arrow is drawn


class ObstacleViewParameters(Parameters):
    """What the recordings of demonstrations and of models show."""

    scenarios: tuple[str, ...] = Field(min_length=1)


@dataclass(frozen=True)
class ShownScenario:
    """A scenario, how people avoided its obstacle, and how the models do."""

    scenario: Scenario  # with its obstacle in the base frame
    cloud: np.ndarray  # (P, 3) m, base frame, the points of the obstacle that models see
    demonstrations: Sequence[Demonstration]  # of people
    targets: pd.DataFrame  # of what the demonstrations teach, columns `demonstration`, `time_s`, `target_x`
    reaches: Group  # of the models; that without avoidance is among them


def chosen_scenarios(places: Sequence[Scenario], names: Sequence[str]) -> dict[int, Scenario]:
    """Scenarios by their number in the dataset, in the order of the names.

    Raises InputError: there is no scenario of a name.
    """
    known = {place.name: number for number, place in enumerate(places)}
    missing = [name for name in names if name not in known]
    if missing:
        raise InputError(
            f"inspect_obstacles.scenarios: there is no '{missing[0]}'; names are '{places[0].name}' to "
            f"'{places[-1].name}'"
        )
    return {known[name]: places[known[name]] for name in names}


def shown_scenarios(
    chosen: Mapping[int, Scenario],
    demonstrations: Sequence[Sequence[Demonstration]],
    samples: pd.DataFrame,
    reaches: Mapping[SituationKey, Group],
    cloud_count: int,
) -> list[ShownScenario]:
    """All that there is of the chosen scenarios.

    `chosen`: of `chosen_scenarios`; `reaches`: of `unrolled_reaches.reaches_by_situation`.
    """
    return [
        ShownScenario(
            scenario,
            scenario.obstacle.cloud(cloud_count),
            people,
            samples[samples["scenario"] == number],
            reaches[SituationKey(TRAINED, scenario.shape, scenario.setting)],
        )
        for (number, scenario), people in zip(chosen.items(), demonstrations, strict=True)
    ]


def in_base_frame(points: np.ndarray, baseline: PositionPrimitive) -> np.ndarray:
    """Points (..., 3) m of the baseline's local frame in the base frame."""
    return baseline.start + points @ baseline_axes(baseline).T


def obstacle_colour(bare: Reach) -> str:
    """Colour of an obstacle, given the reach without avoidance past it."""
    return (HIT if bare.hit else FREE).colour


def send_obstacle(
    stream: rr.RecordingStream, path: str, solid: Obstacle, cloud: np.ndarray, colour: str
) -> None:
    """Log an obstacle at rest: its solid, and its cloud (P, 3) in m, base frame."""
    from scipy.spatial.transform import Rotation

    pose: dict[str, Any] = {
        "centers": [solid.centre],
        "quaternions": [Rotation.from_matrix(solid.rotation).as_quat()],  # x, y, z, w
        "colors": rgba([colour], SOLID_OPACITY),
        "fill_mode": FillMode.Solid,
    }
    if solid.shape == "cylinder":
        radius, _, half_height = solid.half_size
        body: rr.AsComponents = rr.Cylinders3D(lengths=[2.0 * half_height], radii=[radius], **pose)
    else:
        drawn = rr.Boxes3D if solid.shape == "cube" else rr.Ellipsoids3D
        body = drawn(half_sizes=[solid.half_size], **pose)
    stream.log(f"{path}/solid", body, static=True)
    stream.log(f"{path}/cloud", rr.Points3D(cloud, colors=rgba([colour]), radii=-1.5), static=True)


def send_sphere(
    stream: rr.RecordingStream,
    path: str,
    cloud: np.ndarray,
    radius: float,
    indexes: Sequence[rr.TimeColumn],
    centres: np.ndarray,
    colours: Sequence[str],
) -> None:
    """Log a sphere that changes its place and its colour.

    `cloud` (P, 3) m, relative to its centre; `radius`: m; `indexes`: the time lines, each with T times;
    `centres` (T, 3) m; `colours`: T of them.
    """
    solid = rr.Ellipsoids3D(half_sizes=[[radius] * 3], fill_mode=FillMode.Solid)
    stream.log(f"{path}/solid", solid, static=True)
    stream.log(f"{path}/cloud", rr.Points3D(cloud, radii=-1.5), static=True)
    pale = rr.Ellipsoids3D.columns(colors=rgba(colours, SOLID_OPACITY))
    stream.send_columns(path, indexes, rr.Transform3D.columns(translation=centres))
    stream.send_columns(f"{path}/solid", indexes, pale)
    stream.send_columns(f"{path}/cloud", indexes, rr.Points3D.columns(colors=rgba(colours)))


def send_paths(
    stream: rr.RecordingStream,
    path: str,
    positions: Sequence[np.ndarray],
    colour: str,
    opacity: float = 1.0,
    width: float = 1.0,
) -> None:
    """Log whole paths, each (T, 3) m, as lines with a half width in points."""
    strips = rr.LineStrips3D(list(positions), colors=rgba([colour], opacity), radii=-width)
    stream.log(path, strips, static=True)


def send_hand(
    stream: rr.RecordingStream, path: str, time: np.ndarray, position: np.ndarray, colour: str
) -> None:
    """Log where a hand is over time (T,) in s, as a point (T, 3) in m."""
    send_moving_frame(stream, path, [time_column(time)], position, None, colour, 0.0)


def send_arrows(stream: rr.RecordingStream, path: str, reach: Reach, colour: str) -> None:
    """Log the coupling term along a whole path."""
    kept = slice(None, None, ARROW_EVERY)
    arrows = rr.Arrows3D(
        origins=reach.position[kept],
        vectors=arrow_vectors(reach.coupling_in_base[kept]),
        colors=rgba([colour], 0.8),
        radii=-0.8,
    )
    stream.log(path, arrows, static=True)


def send_trail(stream: rr.RecordingStream, path: str, reach: Reach, colour: str) -> None:
    """Log a reach as it comes about: its hand with the coupling term, and the path that lies behind it."""
    times = [time_column(reach.time)]
    send_hand(stream, f"{path}/hand", reach.time, reach.position, colour)
    stream.log(f"{path}/trail", rr.LineStrips3D.from_fields(colors=rgba([colour]), radii=-1.5), static=True)
    trails = [reach.position[: max(end, 2)] for end in range(1, len(reach.time) + 1)]
    stream.send_columns(f"{path}/trail", times, rr.LineStrips3D.columns(strips=trails))
    stream.log(f"{path}/coupling", rr.Arrows3D.from_fields(colors=rgba([colour]), radii=-1.5), static=True)
    arrows = rr.Arrows3D.columns(origins=reach.position, vectors=arrow_vectors(reach.coupling_in_base))
    stream.send_columns(f"{path}/coupling", times, arrows)


def arrow_vectors(coupling: np.ndarray) -> np.ndarray:
    """Vectors in m, (N, 3), that stand for coupling terms (N, 3) in m; see `LONGEST_ARROW_M`."""
    vectors = ARROW_SCALE * coupling
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors * np.minimum(1.0, LONGEST_ARROW_M / np.maximum(length, LONGEST_ARROW_M))


def send_scenario(stream: rr.RecordingStream, one: ShownScenario) -> np.ndarray:
    """Log the obstacle, demonstrated paths, and the reach without avoidance.

    Returns all points that a view of the scenario has to show, (N, 3) m.
    """
    name, bare = one.scenario.name, without_avoidance(one.reaches)
    demonstrated = [person.position for person in one.demonstrations]
    colour = obstacle_colour(bare)
    send_obstacle(stream, entity(name, "obstacle"), one.scenario.obstacle, one.cloud, colour)
    send_paths(stream, entity(name, "demonstrated"), demonstrated, DEMONSTRATIONS.colour, PALE)
    send_paths(stream, entity(name, BARE.name, "path"), [bare.position], BARE.colour, width=2.0)
    send_hand(stream, entity(name, BARE.name, "hand"), bare.time, bare.position, BARE.colour)
    return np.concatenate([one.cloud, bare.position, *demonstrated])
