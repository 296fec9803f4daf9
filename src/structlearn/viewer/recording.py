"""Writing .rrd files."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from structlearn.core.artefacts import publish
from structlearn.core.errors import InputError
from structlearn.viewer.items import TIME, Item
from structlearn.viewer.views import Panel


class Recording(NamedTuple):
    """What a file shows; the time line is played in a loop, integer ones at `steps_per_s`."""

    title: str
    content: Panel
    timeline: str = TIME
    steps_per_s: float | None = None


def publish_recordings(folder: str | Path, recordings: Mapping[str, Recording]) -> None:
    """Write recordings, keyed by the names of their files, to a new folder; see `write`."""
    with publish(folder) as made:
        made.mkdir()
        for name, recording in recordings.items():
            write(made / f"{name}.rrd", recording)


def write(path: str | Path, recording: Recording) -> None:
    """Write a recording.

    Data are collected in memory, since rerun's file sink reports a full disk in its log at most. The viewer
    keeps one blueprint per application and merges recordings of equal id; both are named after the title, so
    that several recordings can be open side by side. No wall-clock time is logged.

    Raises OSError: the file cannot be written; InputError: it cannot be read back.
    """
    title, content, timeline, steps_per_s = recording
    application = f"structlearn: {re.sub(r'[^A-Za-z0-9 ,:_-]', '', title)}"  # rerun replaces other characters
    stream = rr.RecordingStream(application, recording_id=title, send_properties=False)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    memory = stream.memory_recording()
    try:
        stream.send_recording_name(title)
        for item in dict.fromkeys(content.items):  # views share some
            _send(stream, item)
        looped: dict[str, Any] = {"timeline": timeline, "play_state": "playing", "loop_mode": "all"}
        side = rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed")
        time = rrb.TimePanel(state="collapsed", fps=steps_per_s, **looped)
        stream.send_blueprint(rrb.Blueprint(content.layout, *side, time))
        written = memory.drain_as_bytes()  # with the footer that `rerun rrd verify` requires
    finally:
        stream.disconnect()
    Path(path).write_bytes(written)
    try:
        RrdReader(path).recordings()  # requires the footer
    except RuntimeError as error:
        raise InputError(f"{path}: is not on the disk as it was written: {error}") from error


def _send(stream: rr.RecordingStream, item: Item) -> None:
    if item.chunks is not None:
        stream.send_chunks(item.chunks)
    if item.still:
        stream.reset_time()
        for name, step in (item.at or {}).items():
            stream.set_time(name, **_unit(step))
        stream.log(item.path, *item.still, static=item.at is None)
    if item.times is not None:
        times = item.times if isinstance(item.times, Mapping) else {TIME: item.times}
        every = [rr.TimeColumn(name, **_unit(values)) for name, values in times.items()]
        stream.send_columns(item.path, every, item.columns)


def _unit(times: Any) -> dict[str, Any]:
    """Keyword of rerun for steps, which are integers, or times in s."""
    return {"sequence" if np.issubdtype(np.asarray(times).dtype, np.integer) else "duration": times}
