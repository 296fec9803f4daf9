"""Recording of executions on the tilted board: without feedback, corrected by a person, with feedback."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.palette import LIGHT_GREY, ORANGE, SKY, primitive_colour
from structlearn.testbeds.scraping.recordings.finger_electrodes import (
    full_scale,
    map_view,
    send_electrode_map,
)
from structlearn.testbeds.scraping.recordings.scraping_scene import (
    EYE_M,
    close_view,
    send_board,
    send_hand,
    send_path,
    send_tool,
)
from structlearn.testbeds.scraping.recordings.shown_execution import (
    HEADINGS,
    Execution,
    send_board_roll,
    send_signals,
    signal_plots,
)
from structlearn.viewer.rrd import (
    VIEW_RATE_HZ,
    entity,
    lanes,
    layout,
    origin_label,
    recording,
    send_primitive_lane,
    thinning,
    time_column,
)

RUN_COLOURS = (LIGHT_GREY, ORANGE, SKY)
"""Of the runs in one setting, in their order."""


@dataclass(frozen=True)
class Comparison:
    """How the executions of a setting are put beside each other.

    Attributes:
        shadows: labels of executions that have no scene of their own, and of those in whose scene they are
            drawn pale.
        headings: of the signals that are plotted, see `run.send_signals`.
        rate_hz: of poses and signals.
        distance_m: of the camera.
    """

    shadows: Mapping[str, str] = field(default_factory=dict)
    headings: Mapping[str, str] = field(default_factory=lambda: HEADINGS)
    rate_hz: float = VIEW_RATE_HZ
    distance_m: float = EYE_M


SIDE_BY_SIDE = Comparison()
"""Every execution in its own scene."""


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
    with recording(path, title) as stream:
        stream.send_blueprint(layout(rrb.Tabs(*setting_tabs(settings, SIDE_BY_SIDE), active_tab=0)))
        send_settings(stream, settings, SIDE_BY_SIDE)


def send_settings(
    stream: rr.RecordingStream, settings: Mapping[float, Sequence[Execution]], comparison: Comparison
) -> None:
    """Log the executions of all settings; colours of electrodes are comparable among all of them."""
    scale = _full_scale(settings)
    for setting, group in settings.items():
        tab = _tab(setting)
        for place, one in enumerate(group):
            _send_execution(stream, tab, one, RUN_COLOURS[place % len(RUN_COLOURS)], scale, comparison)
        send_board_roll(stream, tab, group[0])
        _send_lane(stream, tab, group[0])


def setting_tabs(settings: Mapping[float, Sequence[Execution]], comparison: Comparison) -> list[rrb.Vertical]:
    """Tabs of what `send_settings` logs, in the order of the settings."""
    scale = _full_scale(settings)
    return [_setting_tab(setting, group, scale, comparison) for setting, group in settings.items()]


def _full_scale(settings: Mapping[float, Sequence[Execution]]) -> float:
    return full_scale([one for group in settings.values() for one in group])


def _tab(setting: float) -> str:
    return f"{setting:g} degrees"


def _send_execution(
    stream: rr.RecordingStream, tab: str, one: Execution, colour: str, scale: float, comparison: Comparison
) -> None:
    kept = slice(None, None, thinning(one.run.dt, comparison.rate_hz))
    shadow = one.label in comparison.shadows
    scene = entity(tab, "runs", one.label)
    if not shadow:
        send_board(stream, f"{scene}/board", one.board_deg)
        send_path(stream, f"{scene}/path", one, kept, colour)
    send_hand(stream, f"{scene}/hand", one, kept, colour, scale, shadow)
    send_tool(stream, f"{scene}/tool", one, kept, colour, shadow)
    send_electrode_map(stream, entity(tab, "electrodes", one.label), one, scale)
    send_signals(stream, tab, one, kept, colour, comparison.headings)


def _send_lane(stream: rr.RecordingStream, tab: str, one: Execution) -> None:
    """Which primitive runs; the same in all runs of a setting."""
    colours = {name: primitive_colour(place) for place, name in enumerate(one.primitives)}
    segments = one.run.true_segments
    times = [time_column(np.append(segments[:, 0], segments[-1, 1]))]
    send_primitive_lane(stream, entity(tab, "primitive"), times, [*one.primitives, ""], colours)


def _setting_tab(
    setting: float, group: Sequence[Execution], scale: float, comparison: Comparison
) -> rrb.Vertical:
    tab = _tab(setting)
    origin = origin_label([one.run for one in group])
    scenes = [
        _scene(tab, one.label, origin, comparison) for one in group if one.label not in comparison.shadows
    ]
    maps = [
        map_view(
            f"{one.label}: ±{scale:.0f} counts, blue is below expected",
            entity(tab, "electrodes", one.label),
        )
        for one in group
    ]
    plots = [*signal_plots(tab, comparison.headings), lanes("Primitives", [entity(tab, "primitive")])]
    return rrb.Vertical(
        rrb.Horizontal(*scenes),
        rrb.Horizontal(*maps),
        rrb.Grid(*plots, grid_columns=3),
        row_shares=[10, 5, 9],
        name=tab,
    )


def _scene(tab: str, label: str, origin: str, comparison: Comparison) -> rrb.Spatial3DView:
    """An execution and its shadows."""
    pale = [shadow for shadow, of in comparison.shadows.items() if of == label]
    heading = f"{label} (pale: {', '.join(pale)})" if pale else label
    shown = [f"{entity(tab, 'runs', one)}/**" for one in (label, *pale)]
    return close_view(f"{heading}, board at {tab}{origin}", shown, comparison.distance_m)
