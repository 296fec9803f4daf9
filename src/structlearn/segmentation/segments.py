"""Semi-automatic segmentation of demonstrations into primitives (algorithm IV.1, IV.9.2).

One demonstration is the reference, cut by zero-velocity crossing. The others are first cut in the same way,
then refined by alignment with the reference. All estimates are kept for comparison: the crossing alone
(`zvc`), the samples that time warping assigns to the reference's ends (`dtw`), ordinary (`ls`) and weighted
(`wls_published`) least squares as printed, and the result, weighted least squares with the crossings as
additional correspondences (`wls`). Tasks on recorded data replace all crossings by extrapolated onsets
(`crossings`).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.core import signals
from structlearn.core.artefacts import publish, read_table, write_table
from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation import alignment
from structlearn.segmentation.alignment import METHODS, RESULT, WARNING_COLUMNS, Movement, Refined
from structlearn.segmentation.crossings import Crossings, find_crossings
from structlearn.segmentation.motion_runs import Strokes, path
from structlearn.segmentation.parameters import BETWEEN, STROKES, SegmentParameters
from structlearn.segmentation.strokes import knots, longest_axis, require_one_period, working_share

STROKE_COLUMNS = ["demonstration", "primitive", "time_s", "cycle"]


@dataclass(frozen=True)
class Segmentation:
    """All cuts of a set of demonstrations."""

    # one row per demonstration, primitive and method; times since the start of the demonstration; columns of
    # all tables: `TABLE_COLUMNS`
    cuts: pd.DataFrame
    pairs: pd.DataFrame  # one row per correspondence; times since the start of either demonstration
    left_out: pd.DataFrame  # demonstrations that could not be cut
    warnings: pd.DataFrame  # of poor cuts (`alignment.cut_warnings`)
    reference: str  # name of the reference demonstration
    # knots of all strokes (`strokes.knots`), for primitives whose number of strokes varies
    strokes: pd.DataFrame = field(default_factory=lambda: pd.DataFrame(columns=STROKE_COLUMNS))
    cells: int = 0  # total size of the warping tables; not kept on disk

    @property
    def primitives(self) -> list[str]:
        """Names of the primitives in order of time."""
        return list(self.cuts["primitive"].unique())

    @property
    def results(self) -> dict[str, pd.DataFrame]:
        """The final cuts of every primitive, in order of time, to learn primitives from.

        Those of a primitive of strokes have a column `knots`, each (K, 2) s and cycles.
        """
        results = {name: self.result(name) for name in self.primitives}
        for name, rows in self.strokes.groupby("primitive"):
            pairs = {run: own[["time_s", "cycle"]].to_numpy() for run, own in rows.groupby("demonstration")}
            results[str(name)] = results[str(name)].assign(knots=pd.Series(pairs))
        return results

    def result(self, primitive: str, method: str = RESULT) -> pd.DataFrame:
        """Cuts of one primitive by one method (the reference's are its crossing); index: demonstration."""
        return self._by_key.get((primitive, method), self.cuts[:0].set_index("demonstration"))

    @cached_property
    def _by_key(self) -> dict[tuple[str, str], pd.DataFrame]:
        """Cuts by primitive and method, sorted out once: viewers ask for each demonstration."""
        groups = self.cuts.groupby(["primitive", "method"], sort=False)
        return {(str(name), str(method)): rows.set_index("demonstration") for (name, method), rows in groups}


def write_segmentation(segmentation: Segmentation, folder: str | Path) -> None:
    """Publish a segmentation as a folder of Parquet tables, one per attribute."""
    tables = vars(segmentation) | {"reference": pd.DataFrame({"reference": [segmentation.reference]})}
    names = [name for name in TABLE_COLUMNS if name != "strokes" or len(segmentation.strokes)]
    with publish(folder) as path:
        path.mkdir()
        for name in names:
            write_table(tables[name], path / f"{name}.parquet")


def read_segmentation(folder: str | Path) -> Segmentation:
    """Read a segmentation. Raises InputError: a table is missing, unreadable or has other columns."""
    paths = {name: Path(folder, f"{name}.parquet") for name in TABLE_COLUMNS}
    if not paths["strokes"].exists():  # no primitive of strokes
        del paths["strokes"]
    tables = {name: read_table(path, TABLE_COLUMNS[name]) for name, path in paths.items()}
    reference = tables.pop("reference")["reference"]
    if len(reference) != 1:
        raise InputError(f"{paths['reference']}: has {len(reference)} rows, not one")
    return Segmentation(reference=reference[0], **tables)


PAIR_COLUMNS = ["demonstration", "primitive", "reference_s", "guess_s", "weight"]

TABLE_COLUMNS = {
    "cuts": ("demonstration", "primitive", "method", "start_s", "end_s"),
    "pairs": tuple(PAIR_COLUMNS),
    "left_out": ("demonstration", "reason"),
    "warnings": tuple(WARNING_COLUMNS),
    "reference": ("reference",),
    "strokes": tuple(STROKE_COLUMNS),
}
"""Columns of the tables, by file."""


def cut(demonstrations: Sequence[Demonstration], parameters: SegmentParameters) -> Segmentation:
    """Cut demonstrations into primitives.

    Raises InputError: no demonstration has the reference's name, sampling intervals differ, the reference
    cannot be cut, another one cannot and failures are not to be skipped, or, if runs are assigned to
    primitives (`assigns_runs`), most cannot.
    """
    first = demonstrations[0]
    for demonstration in demonstrations:
        if abs(demonstration.dt - first.dt) > 1e-6 * first.dt:
            raise InputError(
                f"{demonstration.name}: sampling interval {demonstration.dt:g} s differs from "
                f"{first.dt:g} s of {first.name}"
            )
    place, crossings = find_crossings(demonstrations, parameters)
    reference = demonstrations[place]
    pattern = _movements(reference, crossings[place], parameters)
    poses = (Demonstration(run.name, run.time, run.position, run.orientation) for run in demonstrations)
    aligned = parallel_map(
        partial(_aligned, reference=reference.name, pattern=pattern, parameters=parameters),
        zip(poses, crossings, strict=True),
        "cuts",
    )
    cuts, pairs, warnings, left_out, cells = [], [], [], {}, 0
    strokes: dict[str, dict[str, tuple[Demonstration, Strokes]]] = {}
    for demonstration, found, own in zip(demonstrations, aligned, crossings, strict=True):
        if isinstance(found, InputError):
            if demonstration is reference or not parameters.skip_failures:
                raise found
            left_out[demonstration.name] = str(found)
        else:
            cuts.append(found.cuts)
            pairs += found.pairs
            warnings += found.warnings
            cells += found.cells
            assert not isinstance(own, InputError)
            for name, crossing in own.items():
                if crossing.strokes is not None:
                    run = demonstration, crossing.strokes
                    strokes.setdefault(name, {})[demonstration.name] = run
    if parameters.assigns_runs and 2 * len(left_out) > len(demonstrations):  # then the choice itself is wrong
        raise InputError(
            f"{len(left_out)} of {len(demonstrations)} demonstrations cannot be cut into the primitives that "
            f"are named, more than may be skipped: {next(iter(left_out.values()))}"
        )
    return Segmentation(
        cuts=pd.concat(cuts, ignore_index=True),
        pairs=pd.concat(pairs, ignore_index=True) if pairs else pd.DataFrame(columns=PAIR_COLUMNS),
        left_out=pd.DataFrame(left_out.items(), columns=TABLE_COLUMNS["left_out"]),
        warnings=pd.DataFrame(warnings, columns=WARNING_COLUMNS).astype({"number": float}),
        reference=reference.name,
        strokes=pd.DataFrame(
            [
                row
                for name, runs in strokes.items()
                for row in _stroke_rows(name, runs, reference.name, parameters)
            ],
            columns=STROKE_COLUMNS,
        ),
        cells=cells,
    )


@dataclass(frozen=True)
class _Rows:
    """Rows of a `Segmentation` for one demonstration."""

    cuts: pd.DataFrame
    pairs: list[pd.DataFrame]  # none for the reference
    warnings: list[tuple[str, str, str, float]]
    cells: int


def _aligned(
    work: tuple[Demonstration, Crossings | InputError],
    reference: str,
    pattern: dict[str, Movement],
    parameters: SegmentParameters,
) -> _Rows | InputError:
    """Align one demonstration's movements with the reference's, `pattern`; or why it cannot be cut."""
    demonstration, crossings = work
    own, refined = demonstration.name == reference, {}
    try:
        for name, movement in _movements(demonstration, crossings, parameters).items():
            one, other = (each.crossing.strokes for each in (pattern[name], movement))
            if one is not None and other is not None:
                require_one_period(demonstration.name, other, reference, one, demonstration.dt)
            try:
                refined[name] = alignment.refine_cuts(pattern[name], movement, parameters)
            except ValueError as error:
                raise InputError(f"{demonstration.name}: primitive '{name}': {error}") from error
        cuts = _cut_rows(demonstration, refined, parameters)
    except InputError as error:
        return error
    return _Rows(
        cuts,
        [] if own else [_pair_rows(demonstration.name, *aligned) for aligned in refined.items()],
        alignment.cut_warnings(demonstration.name, refined, own),
        sum(aligned.cells for aligned in refined.values()),
    )


def _movements(
    demonstration: Demonstration, crossings: Crossings | InputError, parameters: SegmentParameters
) -> dict[str, Movement]:
    """Signals to align, per primitive with an axis; raises the reason if there are no crossings."""
    if isinstance(crossings, InputError):
        raise crossings
    dt, movements = demonstration.dt, {}
    axes = {part.name: part.shown_by for part in parameters.primitives if part.name in crossings}
    smooth = {
        axis: signals.low_pass(path(demonstration, axis), dt, parameters.align_cutoff_hz)
        for axis in dict.fromkeys(axes.values())
    }
    velocity = {axis: signals.derivative(values, dt) for axis, values in smooth.items()}
    strokes = {name for name, axis in axes.items() if axis == STROKES}
    for name, before, after in zip(crossings, [None, *crossings], [*list(crossings)[1:], None], strict=False):
        crossing, moved, speed = crossings[name], smooth[axes[name]], velocity[axes[name]]
        if name not in strokes and strokes & {before, after}:
            # From where or whither it leads depends on the number of strokes, how far it has come does not
            fixed = moved[crossing.end if before in strokes else crossing.start]
            moved = np.linalg.norm(moved - fixed, axis=1)[:, None]
            speed = signals.derivative(moved, dt)
        movements[name] = Movement(dt, moved, speed, crossing)
    return movements


def _cut_rows(
    demonstration: Demonstration, refined: dict[str, Refined], parameters: SegmentParameters
) -> pd.DataFrame:
    """Rows of `Segmentation.cuts`, clipped to the recording, with `between` primitives filled in."""
    dt, duration = demonstration.dt, demonstration.time[-1]
    rows = []
    for method in METHODS:
        ends = {name: aligned.ends(method) for name, aligned in refined.items()}
        for index, primitive in enumerate(parameters.primitives):
            if primitive.axis == BETWEEN:
                before, after = parameters.primitives[index - 1], parameters.primitives[index + 1]
                start, end = ends[before.name][1], ends[after.name][0]
            else:
                start, end = ends[primitive.name]
            start_s, end_s = np.clip([start * dt, end * dt], 0.0, duration)
            if method == RESULT and end_s - start_s < 2 * dt:
                raise InputError(
                    f"{demonstration.name}: primitive '{primitive.name}' is empty: it would last from "
                    f"{start_s:.3f} to {end_s:.3f} s"
                )
            rows.append((demonstration.name, primitive.name, method, start_s, end_s))
    return pd.DataFrame(rows, columns=TABLE_COLUMNS["cuts"])


def _stroke_rows(
    primitive: str,
    runs: Mapping[str, tuple[Demonstration, Strokes]],
    reference: str,
    parameters: SegmentParameters,
) -> Iterator[tuple[str, str, float, float]]:
    """Rows of `Segmentation.strokes`; phases are those of the reference."""
    working = working_share([strokes for _, strokes in runs.values()])
    axis = longest_axis(runs[reference][0].position, runs[reference][1])
    for name, (run, strokes) in runs.items():
        smooth = signals.low_pass(run.position, run.dt, parameters.align_cutoff_hz)
        for sample, cycle in knots(smooth, strokes, axis, working).tolist():
            yield name, primitive, run.dt * sample, cycle


def _pair_rows(demonstration: str, primitive: str, aligned: Refined) -> pd.DataFrame:
    reference_s = aligned.reference.dt * aligned.pairs[:, 0]
    guess_s = aligned.own.dt * aligned.pairs[:, 1]
    columns = (demonstration, primitive, reference_s, guess_s, aligned.weights)
    return pd.DataFrame(dict(zip(PAIR_COLUMNS, columns, strict=True)))


def commanded_cuts(runs: Sequence[Demonstration], names: Sequence[str]) -> dict[str, pd.DataFrame]:
    """Commanded segments of executions, from their `true_segments` (P, 2).

    By primitive: index demonstration, columns `start_s` and `end_s`.
    """
    labels = pd.Index([run.name for run in runs], name="demonstration")
    segments = [run.true_segments for run in runs if run.true_segments is not None]
    return {
        name: pd.DataFrame([rows[place] for rows in segments], columns=["start_s", "end_s"], index=labels)
        for place, name in enumerate(names)
    }


def execution_cuts(
    runs: Sequence[Demonstration], names: Sequence[str], parameters: SegmentParameters
) -> dict[str, pd.DataFrame]:
    """Segments of executions as `commanded_cuts` or, if a run has no commanded segments, by segmentation.

    Strokes are always segmented, and have `knots`, since their number is not commanded.

    `parameters`: of the segmentation. The first run stands in for its reference, a demonstration; failures
    raise. Raises InputError: a run without commanded segments cannot be cut.
    """
    counted = any(primitive.axis == STROKES for primitive in parameters.primitives)
    if not counted and all(
        run.true_segments is not None and len(run.true_segments) == len(names) for run in runs
    ):
        return commanded_cuts(runs, names)
    results = cut(runs, parameters.model_copy(update={"reference": None, "skip_failures": False})).results
    return {name: results[name].filter(items=["start_s", "end_s", "knots"]) for name in names}
