"""Recording of reaches past obstacles: the recorded hand and hands of models in the same scenes."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb

from structlearn.palette import BLACK, DEMONSTRATION_COLOUR, GREY, LIGHT_GREY, SCENE_MODELS, Look
from structlearn.tasks.task_files import TaskFiles
from structlearn.viewer import rrd
from structlearn.viewer.rrd import Recording, below, entity, rgba

LOOKS = {"recorded": Look("recorded", DEMONSTRATION_COLOUR)} | {
    model: Look(look.name, LIGHT_GREY if look.colour == BLACK else look.colour)  # the viewer is black
    for model, look in SCENE_MODELS.items()
    if model in ("none", "published", "scene", "planned")  # all six would hide each other
}

# eye position relative to the middle of a scene: behind the person and above, so that gaps are visible
EYE_M = np.array([0.0, -0.55, 0.75])
EXTENT, PLACE = ["width_m", "depth_m", "height_m"], ["x_m", "y_m", "z_m"]


NOTE = (
    "The obstacles and the hand called *recorded* are recordings. The other hands are computed: models "
    "trained on other people move them through this scene, with the duration of this person. Obstacles are "
    "filled, walls are outlined; a square of the floor is 0.1 m wide."
)

NOTHING = "The task has no reaches past obstacles."


def write(files: TaskFiles, folder: Path) -> None:
    """Write the recording of the reaches that the page shows."""
    tables = {name: files.table(f"obstacles/{name}") for name in ("paths", "shapes")}
    if len(tables["paths"]):
        title = f"{files.name}: reaches past obstacles"
        write_reaches_past_obstacles(folder / "obstacles.rrd", tables, title)


def write_reaches_past_obstacles(path: str | Path, tables: Mapping[str, pd.DataFrame], title: str) -> None:
    """Record the reaches shown on the page, one tab per scene.

    `tables`: `paths` and `shapes` of `learning.SceneResults`.
    """
    colours = rrd.legend({look.name: look.colour for look in LOOKS.values()})
    with rrd.recording(path, title) as to:
        to.notes(f"# {title}\n\n{NOTE}\n\n{colours}")
        tabs = []
        for name, paths in tables["paths"].groupby("reach", sort=False):
            shapes = tables["shapes"].query("reach == @name")
            middle, floor = _send_shapes(to, name, shapes)
            for model, look in LOOKS.items():
                _send_path(to, name, look, paths[paths["model"] == model], shapes[shapes["box"]])
            scene = rrd.eye_view(name, [below(name)], middle, EYE_M, floor)
            clearance = rrd.plot("distance to the nearest obstacle (mm)", [below("distance", name)])
            beside = rrb.Vertical(rrd.notes_view(), clearance)
            tabs.append(rrb.Horizontal(scene, beside, column_shares=[2, 1], name=name))
        to.show(tabs)


def _send_shapes(to: Recording, name: str, shapes: pd.DataFrame) -> tuple[np.ndarray, float]:
    """Log obstacles, walls and axes; return the obstacles' mean centre (3,) m and the floor's height in m."""
    sizes, centres = (shapes[columns].to_numpy() for columns in (EXTENT, PLACE))
    solid = shapes["box"].to_numpy(bool)
    to.boxes(entity(name, "obstacles"), sizes[solid], centres[solid], [GREY])
    edges = rr.components.FillMode.MajorWireframe
    walls = rr.Boxes3D(sizes=sizes[~solid], centers=centres[~solid], colors=rgba(LIGHT_GREY), fill_mode=edges)
    to.still(entity(name, "walls"), walls)
    floor = to.floor_axes(entity(name, "axes"), (centres - 0.5 * sizes)[solid])
    return centres[solid].mean(axis=0), floor


def _send_path(to: Recording, name: str, look: Look, samples: pd.DataFrame, boxes: pd.DataFrame) -> None:
    """Log a hand over time, its whole path as a line, and its distance from the obstacles' extents."""
    points, time = samples[PLACE].to_numpy(), samples["time_s"].to_numpy()
    width = 1.0 if look.colour == LIGHT_GREY else 2.0
    path = entity(name, look.name)
    to.lines(f"{path}/path", [points], look.colour, -width)
    to.moving_frame(f"{path}/hand", time, points, look.colour)
    beyond = np.abs(points[:, None] - boxes[PLACE].to_numpy()) - 0.5 * boxes[EXTENT].to_numpy()
    apart = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1).min(axis=1)
    to.series(entity("distance", name, look.name), time, 1e3 * apart, look.name, look.colour)
