"""Fair timing of several ways to do the same work: checked first, then interleaved, reported as medians.

A machine's speed drifts (clock, other processes), so runs of ours and of the peers alternate, A B A B, and
only the ratio of medians within one case means something. A short run directly after another library's long
one finds the processor's caches full of foreign things; what it takes when repeated at once is kept too
(`again`), but the verdict is on the first. Before anything is timed each contender's result is held against
one reference: what is faster because it does something else is not in the table.
"""

import argparse
import csv
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from statistics import median
from time import perf_counter, sleep
from typing import Any

SECONDS_PER_CASE = 3.0
FEWEST_ROUNDS, MOST_ROUNDS, MOST_PACED = 7, 201, 10_000


def at_least_one(word: str) -> int:
    """A count on the command line."""
    if not (word.isdecimal() and int(word)):
        raise argparse.ArgumentTypeError(f"{word!r} is not a count of one or more")
    return int(word)


@dataclass(frozen=True)
class Contender:
    """One way to do the work of a case.

    Attributes:
        run: does the work once; only this is timed.
        error: deviation of run's result from the case's reference, relative to the reference's size.
    """

    run: Callable[[], Any]
    error: Callable[[Any], float]


@dataclass(frozen=True)
class Case:
    """A row of the speed specification.

    Attributes:
        work: what is done.
        ours: how structlearn does it.
        peers: name -> builder; a builder imports its library and raises ImportError when that is absent.
        aim_ms: the median to stay below; None: no aim was set.
        tolerance: largest `error` that still counts as the same result (first-order integrators need some).
        note: what the row includes or leaves out.
        period_s: a run begins once in so many seconds, and the processor sleeps in between, as in a control
            loop; 0: runs follow one another.
    """

    work: str
    ours: Contender
    peers: Mapping[str, Callable[[], Contender]] = field(default_factory=dict)
    aim_ms: float | None = None
    tolerance: float = 0.03
    note: str = ""
    period_s: float = 0.0


@dataclass(frozen=True)
class Row:
    """One line of the table; None where there is nothing to say."""

    work: str
    median_ms: float
    min_ms: float
    again_ms: float
    aim_ms: float | None
    aim_met: str | None
    error: float
    peer: str | None
    peer_median_ms: float | None
    peer_again_ms: float | None
    peer_error: float | None
    ratio: float | None


def machine() -> str:
    """Name of the machine that is measured, and how busy it is: what timings cannot be read without."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    name = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), "unknown")
    load = os.getloadavg()[0]
    return f"{name}, {os.cpu_count()} cores, {platform.system()} {platform.release()}; load {load:.1f}"


def measure(case: Case, seconds: float = SECONDS_PER_CASE) -> list[Row]:
    """Check all contenders of a case, then time them in turns.

    Args:
        case: the work.
        seconds: time to spend on the case.

    Returns:
        One row per peer, or a single one without peer.

    Raises:
        ValueError: a contender's result is not that of the reference.
    """
    contenders = {"structlearn": case.ours}
    for name, build in case.peers.items():
        try:
            contenders[name] = build()
        except ImportError:
            continue
    errors = {name: _checked(case, name, contender) for name, contender in contenders.items()}
    runs = {name: contender.run for name, contender in contenders.items()}
    samples, repeated = _interleaved(runs, seconds, case.period_s)
    medians = {name: 1e3 * median(times) for name, times in samples.items()}
    again = {name: 1e3 * median(times) for name, times in repeated.items()}
    ours = medians["structlearn"]
    row = {
        "work": case.work,
        "median_ms": ours,
        "min_ms": 1e3 * min(samples["structlearn"]),
        "again_ms": again["structlearn"],
        "aim_ms": case.aim_ms,
        "aim_met": None if case.aim_ms is None else "yes" if ours <= case.aim_ms else "no",
        "error": errors["structlearn"],
    }
    return [
        Row(
            **row,
            peer=name if name in medians or name is None else f"{name}: not installed",
            peer_median_ms=medians.get(name),
            peer_again_ms=again.get(name),
            peer_error=errors.get(name),
            ratio=medians[name] / ours if name in medians else None,
        )
        for name in (case.peers or [None])
    ]


def _checked(case: Case, name: str, contender: Contender) -> float:
    """Error of a contender's first result; the run compiles what is compiled on first use."""
    error = contender.error(contender.run())
    if not error <= case.tolerance:
        raise ValueError(f"{case.work}: {name} is off by {error:.2g}, allowed are {case.tolerance:.2g}")
    return error


Samples = dict[str, list[float]]


def _interleaved(
    runs: Mapping[str, Callable[[], Any]], seconds: float, period_s: float
) -> tuple[Samples, Samples]:
    """Durations in s of the runs, in turns until the time is up, and of the immediate repetition of each."""
    for run in runs.values():
        run()
    first: Samples = {name: [] for name in runs}
    again: Samples = {name: [] for name in runs}
    most = MOST_PACED if period_s else MOST_ROUNDS
    begin = perf_counter()
    for done in range(most):
        if done >= FEWEST_ROUNDS and perf_counter() - begin > seconds:
            break
        for name, run in runs.items():
            sleep_to_next(period_s)
            for samples in (first, again):
                start = perf_counter()
                run()
                samples[name].append(perf_counter() - start)
    return first, again


def sleep_to_next(period_s: float) -> None:
    """Sleep until the clock's next multiple of a period."""
    if period_s:
        sleep(period_s - perf_counter() % period_s)


def table(rows: Sequence[Row]) -> str:
    """Rows as aligned text; a work's own numbers are printed once."""
    header = ["work", "ours ms", "min", "again", "aim", "met", "off by", "peer", "peer ms", "off by", "ratio"]
    cells = [header]
    for row, previous in zip(rows, [None, *rows], strict=False):
        ours = [
            row.work,
            *map(_number, (row.median_ms, row.min_ms, row.again_ms, row.aim_ms)),
            row.aim_met or "-",
        ]
        ours.append(f"{row.error:.0e}")
        if previous is not None and previous.work == row.work:
            ours = [""] * len(ours)
        off = "-" if row.peer_error is None else f"{row.peer_error:.0e}"
        ratio = "-" if row.ratio is None else f"{row.ratio:.1f}"
        cells.append([*ours, row.peer or "-", _number(row.peer_median_ms), off, ratio])
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = [
        "  ".join(
            text.ljust(width) if column in (0, 7) else text.rjust(width)
            for column, (text, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in cells
    ]
    return "\n".join([lines[0], "-" * max(map(len, lines)), *lines[1:]])


def write_csv(rows: Sequence[Row], path: Path) -> None:
    """Write the rows with full precision, one column per attribute of `Row`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, fieldnames=list(asdict(rows[0])))
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}" if value < 1000 else f"{value:.0f}"
