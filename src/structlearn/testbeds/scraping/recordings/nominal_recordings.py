"""Recordings of the movements over the level board: as they were demonstrated, and as they were learned."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import pandas as pd
import rerun as rr

from structlearn.primitives.sequence import PosePrimitive
from structlearn.recordings.demonstration import Demonstration
from structlearn.segmentation.result import Segmentation
from structlearn.testbeds.scraping.recordings.scraping_scene import SKIN, send_board, send_hand, send_tool
from structlearn.testbeds.scraping.world.layout import EDGE_M
from structlearn.viewer import learned_primitives, recorded_demonstrations
from structlearn.viewer.rrd import entity

DEMONSTRATED = """A person guides the tool down to the level board, turns it and scrapes. Coloured by the
primitive that they were cut into, white outside (dissertation IV.5). The hand is that of {reference}; every
demonstration has a tab with its signals."""

LEARNED = """Thick: the primitives in turn, from and to the mean start and goals (nominal) and others
(generalised); faint: demonstrations (dissertation IV.4, IV.5). The hand is on the nominal path."""

SUNK_M = 0.002
"""How far the board is drawn below where it is: the edge frame sinks into it while the tool is pressed on."""


def write_demonstrations(
    path: str | Path, demonstrations: Sequence[Demonstration], segmentation: Segmentation, title: str
) -> None:
    """Write demonstrations over the board as a recording, see `recorded_demonstrations`."""
    note = DEMONSTRATED.format(reference=segmentation.reference)
    scenery = partial(_send_scenery, hand=entity("hands", segmentation.reference))
    recorded_demonstrations.write_demonstrations(path, demonstrations, segmentation, title, note, scenery)


def write_primitives(
    path: str | Path,
    demonstrations: Sequence[Demonstration],
    primitives: Sequence[PosePrimitive],
    paths: Mapping[str, pd.DataFrame],
    title: str,
) -> None:
    """Write learned primitives over the board as a recording, see `learned_primitives`."""
    scenery = partial(_send_scenery, hand=entity("hands", next(iter(paths))))
    learned_primitives.write_primitives(path, demonstrations, primitives, paths, title, LEARNED, scenery)


def _send_scenery(stream: rr.RecordingStream, hand: str) -> list[str]:
    """Log the level board, and below the entity of a moving frame a hand with the tool; see `Scenery`."""
    stream.log("scenery", rr.Transform3D(translation=[0.0, 0.0, -SUNK_M]), static=True)
    send_board(stream, "scenery/board")
    send_hand(stream, hand)
    grasp = rr.Transform3D(translation=[0.0, 0.0, -EDGE_M])  # where it is while nothing pulls at the tool
    stream.log(f"{hand}/tool", grasp, static=True)
    send_tool(stream, f"{hand}/tool", SKIN)
    return ["/scenery/**"]
