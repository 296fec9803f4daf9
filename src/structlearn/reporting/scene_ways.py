"""Reaches through scenes of obstacles by who or what moves the hand: numbers and pictures."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from structlearn.palette import GREY, LIGHT_GREY, SCENE_WAYS, Look
from structlearn.reporting.claims import Evidence, clustered_share, mean

RECORDED, OURS, TEXT, NONE, PLANNED = "recorded", "scene", "text", "none", "planned"

WIDTHS = {RECORDED: 3.5, NONE: 1.0, TEXT: 1.3, OURS: 1.8, PLANNED: 1.0}
"""Ways that are drawn, with the width of their lines."""


@dataclass(frozen=True)
class SceneWays:
    """What the folds showed."""

    tables: Mapping[str, pd.DataFrame]  # those of `avoidance.scene_folds.SceneResults`, by name

    def __getitem__(self, name: str) -> pd.DataFrame:
        return self.tables[name]

    @cached_property
    def ways(self) -> list[str]:
        """Keys of `SCENE_WAYS` that were tried, in their order."""
        tried = set(self["reaches"]["way"])
        return [way for way in SCENE_WAYS if way in tried]

    def of(self, way: str, blocked: bool = False) -> pd.DataFrame:
        """Reaches of one way; of those alone whose straight line an obstacle blocks."""
        its = self["reaches"].query("way == @way")
        return its[its["blocked"]] if blocked else its

    def by_person(self, way: str, column: str) -> pd.Series:
        """Mean of a column for each person."""
        return self.of(way).groupby("person")[column].mean()

    def share(self, column: str, way: str = OURS, blocked: bool = False) -> Evidence:
        """Share of the reaches of one way, its interval clustered by person."""
        people = self.of(way, blocked).groupby("person")[column]
        return clustered_share(people.sum().to_numpy(int), people.size().to_numpy())

    def mean_path(self, way: str = OURS) -> Evidence:
        """Distance in mm from recorded paths, mean over people of each one's mean."""
        return mean(self.by_person(way, "path_mm").to_numpy())

    def draw_paths(self, axes: Axes, reach: str, recorded: Look) -> None:
        """One reach from above in mm, with those of ways that had never seen its person; walls are pale."""
        for row in self["shapes"].query("reach == @reach").itertuples():
            corner = (1e3 * (row.x_m - 0.5 * row.width_m), 1e3 * (row.y_m - 0.5 * row.depth_m))
            size, colour = (1e3 * row.width_m, 1e3 * row.depth_m), GREY if row.box else LIGHT_GREY
            axes.add_patch(Rectangle(corner, *size, color=colour, linewidth=0))
        paths = self["paths"].query("reach == @reach")
        for way, width in WIDTHS.items():
            its, look = paths[paths["way"] == way], recorded if way == RECORDED else SCENE_WAYS[way]
            style: dict[str, Any] = {"color": look.colour, "linewidth": width, "label": look.name}
            axes.plot(1e3 * its["x_m"], 1e3 * its["y_m"], "--" if way == NONE else "-", **style)

    def draw_distances(self, axes: Axes) -> None:
        """Distance from the recorded paths: a stroke per person, a dot for their mean."""
        for place, way in enumerate(self.ways):
            means, colour = self.by_person(way, "path_mm"), SCENE_WAYS[way].colour
            axes.plot(means, np.full(len(means), place), "|", color=colour, markersize=11)
            axes.plot(means.mean(), place, "o", color=colour, markersize=5)

    def name_ways(self, axes: Axes) -> None:
        """All ways from top to bottom."""
        labels = [SCENE_WAYS[way].name.replace(" (", "\n(").replace(", ", ",\n") for way in self.ways]
        axes.set_yticks(range(len(labels)), labels)
        axes.grid(axis="y", visible=False)
        axes.invert_yaxis()
