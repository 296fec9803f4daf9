"""Recording of reaches past obstacles: the recorded hand and hands of models in the same scenes."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
import rerun as rr

from structlearn.palette import BLACK, DEMONSTRATION_COLOUR, GREY, LIGHT_GREY, SCENE_MODELS, Look
from structlearn.tasks.task_files import TaskFiles
from structlearn.viewer import items, views
from structlearn.viewer.items import entity
from structlearn.viewer.recording import Recording

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


def recordings(files: TaskFiles) -> dict[str, Recording]:
    """The recording of the reaches that the page shows."""
    tables = {name: files.table(f"obstacles/{name}") for name in ("paths", "shapes")}
    if not len(tables["paths"]):
        return {}
    return {"obstacles": reaches_past_obstacles(tables, f"{files.name}: reaches past obstacles")}


def reaches_past_obstacles(tables: Mapping[str, pd.DataFrame], title: str) -> Recording:
    """The reaches shown on the page, one tab per scene.

    `tables`: `paths` and `shapes` of `learning.SceneResults`.
    """
    notes = views.notes(f"# {title}\n\n{NOTE}\n\n{views.legend(dict(LOOKS.values()))}")
    tabs = []
    for name, paths in tables["paths"].groupby("reach", sort=False):
        shapes = tables["shapes"].query("reach == @name")
        sizes, centres = (shapes[columns].to_numpy() for columns in (EXTENT, PLACE))
        solid = shapes["box"].to_numpy(bool)
        walls = {"sizes": sizes[~solid], "centers": centres[~solid], "fill_mode": "majorwireframe"}
        shown = [
            items.solid(
                entity(name, "obstacles"), rr.Boxes3D, GREY, sizes=sizes[solid], centers=centres[solid]
            ),
            items.solid(entity(name, "walls"), rr.Boxes3D, LIGHT_GREY, **walls),
            items.floor_axes(entity(name, "axes"), (centres - 0.5 * sizes)[solid]),
        ]
        distances = []
        for model, look in LOOKS.items():
            its = paths[paths["model"] == model]
            points, time, path = its[PLACE].to_numpy(), its["time_s"].to_numpy(), entity(name, look.name)
            width = 1.0 if look.colour == LIGHT_GREY else 2.0
            shown += items.travelled(path, time, points, look.colour, -width)
            # distance from the obstacles' extents
            beyond = np.maximum(np.abs(points[:, None] - centres[solid]) - 0.5 * sizes[solid], 0.0)
            apart = 1e3 * np.linalg.norm(beyond, axis=-1).min(axis=1)
            distances.append(items.series(entity("distance", name, look.name), time, apart, *look))
        scene = views.eye(name, shown, centres[solid].mean(axis=0), EYE_M)
        beside = views.column(notes, views.plot("distance to the nearest obstacle (mm)", distances))
        tabs.append(views.row(scene, beside, shares=[2, 1], name=name))
    return Recording(title, views.tabs(*tabs))
