"""Imported data: sets of recordings with their files, rates and gaps."""

from structlearn.reporting.document import Table
from structlearn.tasks.section import Section
from structlearn.tasks.task_files import TaskFiles


def section(files: TaskFiles) -> Section:
    """Of a task with demonstrations."""
    table = files.table("recorded/came_in")
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
