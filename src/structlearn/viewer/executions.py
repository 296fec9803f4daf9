"""Recording of executions on the tilted board: without feedback, corrected by a person, with feedback."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.palette import LIGHT_GREY, ORANGE, SKY, primitive_colour
from structlearn.viewer.electrodes import full_scale, map_view, send_electrode_map
from structlearn.viewer.recording import (
    entity,
    lanes,
    layout,
    origin_label,
    recording,
    send_primitive_lane,
    thinning,
    time_column,
)
from structlearn.viewer.run import Execution, send_board_roll, send_signals, signal_plots
from structlearn.viewer.testbed import close_view, send_board, send_hand, send_path, send_tool

RUN_COLOURS = (LIGHT_GREY, ORANGE, SKY)
"""Of the runs in one setting, in their order."""


def write_executions(
    path: str | Path, settings: Mapping[float, Sequence[Execution]], title: str = "Executions"
) -> None:
    """Write executions as a recording, on one time line.

    Each setting has a tab: above every run in 3-D and its electrodes, below the signals of all runs.

    Args:
        path: of the .rrd file.
        settings: executions by roll of the board in degrees; those of one setting have different labels. The
            first tab is that of the first setting.
        title: heading, different for every recording.
    """
    every = [one for group in settings.values() for one in group]
    scale = full_scale(every)
    with recording(path, title) as stream:
        stream.send_blueprint(_blueprint(settings, scale))
        for setting, group in settings.items():
            tab = _tab(setting)
            for place, one in enumerate(group):
                _send_execution(stream, tab, one, RUN_COLOURS[place % len(RUN_COLOURS)], scale)
            send_board_roll(stream, tab, group[0])
            _send_lane(stream, tab, group[0])


def _tab(setting: float) -> str:
    return f"{setting:g} degrees"


def _send_execution(stream: rr.RecordingStream, tab: str, one: Execution, colour: str, scale: float) -> None:
    kept = slice(None, None, thinning(one.run.dt))
    scene = entity(tab, "runs", one.label)
    send_board(stream, f"{scene}/board", one.board_deg)
    send_path(stream, f"{scene}/path", one, kept, colour)
    send_hand(stream, f"{scene}/hand", one, kept, colour, scale)
    send_tool(stream, f"{scene}/tool", one, kept, colour)
    send_electrode_map(stream, entity(tab, "electrodes", one.label), one, scale)
    send_signals(stream, tab, one, kept, colour)


def _send_lane(stream: rr.RecordingStream, tab: str, one: Execution) -> None:
    """Which primitive runs; the same in all runs of a setting."""
    colours = {name: primitive_colour(place) for place, name in enumerate(one.primitives)}
    segments = one.run.true_segments
    times = [time_column(np.append(segments[:, 0], segments[-1, 1]))]
    send_primitive_lane(stream, entity(tab, "primitive"), times, [*one.primitives, ""], colours)


def _blueprint(settings: Mapping[float, Sequence[Execution]], scale: float) -> rrb.Blueprint:
    tabs = [_setting_tab(setting, group, scale) for setting, group in settings.items()]
    return layout(rrb.Tabs(*tabs, active_tab=0))


def _setting_tab(setting: float, group: Sequence[Execution], scale: float) -> rrb.Vertical:
    tab = _tab(setting)
    origin = origin_label([one.run for one in group])
    scenes = [
        close_view(f"{one.label}, board at {tab}{origin}", [f"{entity(tab, 'runs', one.label)}/**"])
        for one in group
    ]
    maps = [
        map_view(
            f"{one.label}: ±{scale:.0f} counts, blue is below expected",
            entity(tab, "electrodes", one.label),
        )
        for one in group
    ]
    plots = [*signal_plots(tab), lanes("Primitives", [entity(tab, "primitive")])]
    return rrb.Vertical(
        rrb.Horizontal(*scenes),
        rrb.Horizontal(*maps),
        rrb.Grid(*plots, grid_columns=3),
        row_shares=[10, 5, 9],
        name=tab,
    )
