"""What came in: sets of recordings with their files, rates and gaps."""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from structlearn.recordings import read_recordings
from structlearn.recordings.recording import Recording
from structlearn.reporting.document import Table
from structlearn.testbeds.own.files import TaskFiles
from structlearn.testbeds.own.page.section import Section

WORDS = {
    "joint_positions": "joint positions",
    "joint_velocities": "joint velocities",
    "joint_torques": "joint torques",
    "tool_to_board": "tool to board",
}
"""What kinds of streams are called, where it is not their name."""


def section(files: TaskFiles) -> Section:
    """Of a task with demonstrations."""
    rows = [_row(kind, one) for kind, recordings in _sets(files) for one in recordings]
    table = pd.DataFrame(rows)
    sets = table.groupby("set", sort=False).agg(
        files=("recording", "size"),
        shortest_s=("duration_s", "min"),
        longest_s=("duration_s", "max"),
        rate_hz=("pose_hz", "median"),
        gap_ms=("largest_gap_ms", "max"),
        signals=("signals", "first"),
    )
    headings = {
        "recording": "file",
        "duration_s": "duration (s)",
        "shortest_s": "shortest (s)",
        "longest_s": "longest (s)",
        "pose_hz": "poses (Hz)",
        "rate_hz": "poses (Hz)",
        "largest_gap_ms": "largest gap (ms)",
        "gap_ms": "largest gap (ms)",
    }
    formats = dict.fromkeys(("duration_s", "shortest_s", "longest_s", "pose_hz", "rate_hz"), ".1f")
    formats |= dict.fromkeys(("largest_gap_ms", "gap_ms"), ".0f")
    return Section(
        "came_in",
        "What came in",
        "came_in.html.jinja",
        facts={"clock_hz": files.clock.rate_hz, "stamps": sorted({note for note in table["stamps"] if note})},
        tables={
            "sets": Table(sets.reset_index(), formats, headings),
            "recordings": Table(table, formats, headings),
        },
    )


def _sets(files: TaskFiles) -> Iterator[tuple[str, list[Recording]]]:
    yield "demonstrations", read_recordings(files.folder / "demonstrations")
    if files.has("feedback"):
        yield "executions", read_recordings(files.folder / "executions")
        for setting in files.settings():
            yield f"corrections, {setting}", read_recordings(files.folder / "corrections" / setting)


def _row(kind: str, recording: Recording) -> dict[str, object]:
    pose = next(stream for stream in recording.streams if stream.kind == "pose")
    steps = 1e-9 * np.diff(pose.stamps)
    gaps = [1e-6 * np.diff(stream.stamps).max() for stream in recording.streams]
    kinds = list(dict.fromkeys(stream.kind for stream in recording.streams))
    return {
        "set": kind,
        "recording": recording.name,
        "duration_s": 1e-9 * float(pose.stamps[-1] - pose.stamps[0]),
        "pose_hz": 1.0 / np.median(steps),
        "largest_gap_ms": max(gaps),
        "signals": ", ".join(WORDS.get(one, one) for one in kinds),
        "stamps": recording.provenance.get("stamps", ""),
    }
