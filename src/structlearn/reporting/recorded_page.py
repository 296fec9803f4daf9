"""The page of the recorded data: what was gathered from the stages, its figures, metrics and sentences."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import pandas as pd
from matplotlib.figure import Figure as Picture

from structlearn.params import Parameters
from structlearn.primitives.sequence import PosePrimitive
from structlearn.recordings.demonstration import Demonstration
from structlearn.reporting import recorded_figures, segmentation_figures
from structlearn.reporting.page import Block, Figure, KeyNumber, Link, Links, Page, Prose, Section, Table
from structlearn.reporting.parameter_table import parameter_table
from structlearn.reporting.prose import capitalised, listing
from structlearn.reporting.segmentation_figures import METHOD_NAMES
from structlearn.segmentation.comparison import errors_by_level, errors_by_seed, paired_comparison
from structlearn.segmentation.learning import Segment
from structlearn.segmentation.result import METHODS, RESULT

Sizes = Mapping[str, tuple[int, int]]
Metrics = dict[str, float | int | str | bool | None]

STRONG_RANGE = 20
"""Counts; an electrode that moves more than this stands clear of the sensor's noise of half a count."""

UNITS = {
    "pose": "m",
    "joint_positions": "rad",
    "joint_velocities": "rad/s",
    "joint_torques": "N m",
    "wrench": "N, N m",
    "tactile": "counts",
}


@dataclass(frozen=True)
class RecordedResults:
    """All that the page shows; the attributes are results of the functions in `recorded`."""

    reach_segments: list[Segment]
    reach_primitive: PosePrimitive
    reach_errors: pd.DataFrame
    reach_cut_errors: pd.DataFrame
    own_spread_mm: float
    unscrewing_segments: list[Segment]
    unscrewing_primitive: PosePrimitive
    unscrewing_errors: pd.DataFrame
    execution: list[Demonstration]
    execution_path: pd.DataFrame
    execution_errors: pd.DataFrame
    electrode_scores: pd.DataFrame
    electrode_traces: pd.DataFrame
    clock_errors: pd.DataFrame
    slide_deviations: pd.DataFrame
    slide_statistics: pd.DataFrame

    @cached_property
    def by_seed(self) -> pd.DataFrame:
        """Mean cut error of the reaches per noise level, draw and method."""
        return errors_by_seed(self.reach_cut_errors)

    @cached_property
    def by_level(self) -> pd.DataFrame:
        """The same, over the draws."""
        return errors_by_level(self.by_seed)

    @cached_property
    def reach_fit(self) -> pd.DataFrame:
        """Distance of the primitive from the reaches, learned from or left out."""
        by = self.reach_errors.groupby("left_out")
        return pd.DataFrame(
            {
                "reaches": ["learned from", "left out"],
                "mean_mm": by["mean_mm"].mean().to_numpy(),
                "max_mm": by["max_mm"].max().to_numpy(),
                "end_max_mm": by["end_mm"].max().to_numpy(),
            }
        )

    @cached_property
    def electrodes(self) -> pd.DataFrame:
        """Error of the sensor primitives, over all electrodes and over those that move."""
        rows = []
        for primitive, its in self.electrode_scores.groupby("primitive", sort=False):
            strong = its[its["range"] > STRONG_RANGE]
            rows.append(
                {
                    "primitive": primitive,
                    "rms": its["rms"].median(),
                    "nmse": its["nmse"].median(),
                    "strong": len(strong),
                    "strong_nmse": strong["nmse"].mean(),
                }
            )
        return pd.DataFrame(rows)

    @cached_property
    def slides(self) -> pd.DataFrame:
        """Deviation from the expected traces by group of trials."""
        by = self.slide_deviations.groupby("group", sort=False)
        return pd.DataFrame(
            {
                "group": list(by.groups),
                "trials": by.size().to_numpy(),
                "median_rms": by["rms"].median().to_numpy(),
                "largest_rms": by["rms"].max().to_numpy(),
            }
        )


def metrics(results: RecordedResults) -> Metrics:
    """The flat metrics of the recorded data."""
    values: Metrics = {}
    for row in results.by_level.itertuples():
        level = f"{row.noise_mm:g}".replace(".", "p")
        if row.method == RESULT:
            values[f"reach_cut_error_ms_{level}mm"] = row.mean_ms
        else:
            values[f"reach_cut_error_ms_{level}mm_{row.method}"] = row.mean_ms
    learned, unseen = results.reach_fit.to_dict("records")
    for prefix, row in (("reach_fit", learned), ("reach_left_ten_out", unseen)):
        values |= {f"{prefix}_{name}": row[name] for name in ("mean_mm", "max_mm", "end_max_mm")}
    values["reach_own_spread_mm"] = results.own_spread_mm
    errors = results.unscrewing_errors
    single, joint = errors[errors["learned_from"] != "all"], errors[errors["learned_from"] == "all"]
    values["unscrewing_mean_deg_single"] = single["mean_deg"].mean()
    values["unscrewing_mean_deg_joint"] = joint["mean_deg"].item()
    values["unscrewing_end_deg_single"] = single["end_deg"].max()
    values["unscrewing_end_deg_joint"] = joint["end_deg"].item()
    for row in results.execution_errors.itertuples():
        values[f"scraping_{row.primitive}_mean_mm"] = row.mean_mm
        values[f"scraping_{row.primitive}_mean_deg"] = row.mean_deg
    for row in results.electrodes.itertuples():
        values[f"electrodes_{row.primitive}_median_nmse"] = row.nmse
        values[f"electrodes_{row.primitive}_median_rms_counts"] = row.rms
        values[f"electrodes_{row.primitive}_strong_mean_nmse"] = row.strong_nmse
    for row in results.slides.itertuples():
        values[f"slides_{row.group.replace(' ', '_')}_median_rms_counts"] = row.median_rms
    pose = results.clock_errors.set_index("kind").loc["pose"]
    values["slides_clock_pose_rms_mm"] = 1e3 * pose["rms_error"]
    return values


def tables(results: RecordedResults) -> dict[str, pd.DataFrame]:
    """Tables of the page by name."""
    return {
        "reach_cut_errors": results.by_level,
        "reach_comparison": paired_comparison(results.by_seed),
        "reach_reproduction": results.reach_errors,
        "unscrewing": results.unscrewing_errors,
        "execution": results.execution_errors,
        "electrodes": results.electrode_scores,
        "slide_clock": results.clock_errors,
        "slide_deviations": results.slide_deviations,
    }


def pictures(results: RecordedResults) -> dict[str, Picture]:
    """All figures of the page by name."""
    paths = [orientation for _, orientation in results.unscrewing_segments]
    return {
        "reach_cuts": segmentation_figures.noise_figure(results.by_level, paired_comparison(results.by_seed)),
        "reaches": recorded_figures.reaches_figure(
            results.reach_segments, results.reach_primitive, results.reach_errors
        ),
        "unscrewing": recorded_figures.unscrewing_figure(paths, results.unscrewing_primitive.orientation),
        "execution": recorded_figures.execution_figure(results.execution, results.execution_path),
        "electrodes": recorded_figures.electrodes_figure(results.electrode_traces, results.electrode_scores),
        "slides": recorded_figures.slides_figure(results.slide_statistics, results.slide_deviations),
    }


def recorded_page(
    results: RecordedResults, sizes: Sizes, parameters: Mapping[str, Parameters], recordings: tuple[Link, ...]
) -> Page:
    """The page; figures are expected as `figures/NAME.png`, tables as `tables/NAME.csv`."""
    values = metrics(results)
    return Page(
        title="Recorded data: the same code on people and robots",
        lead=(
            "Public recordings of human reaches, of a robot that unscrews and scrapes with tactile "
            "fingers, and of a tactile finger that slides over two materials. Nothing on this page is "
            "simulated but the rests and the noise that are added to the reaches to know where they begin "
            "and end."
        ),
        key_numbers=(
            KeyNumber(
                f"{values['reach_cut_error_ms_2mm']:.0f} ms", "mean cut error of reaches with 2 mm of noise"
            ),
            KeyNumber(
                f"{values['reach_fit_mean_mm']:.1f} mm", "mean distance of one primitive from 97 reaches"
            ),
            KeyNumber(
                f"{values['unscrewing_mean_deg_joint']:.1f}°", "mean error of one primitive for a full turn"
            ),
            KeyNumber(
                f"{max(results.execution_errors['mean_mm']):.1f} mm", "from a recorded scraping execution"
            ),
        ),
        sections=(
            _reach_cuts(results, sizes),
            _reaches(results, sizes),
            _unscrewing(results, sizes),
            _execution(results, sizes),
            _slides(results, sizes),
            _files(parameters, recordings),
        ),
        back=Link("../index.html", "All testbeds"),
    )


def _figure(name: str, sizes: Sizes, caption: str, alt: str) -> Figure:
    return Figure(f"figures/{name}.png", caption, alt, sizes.get(name))


def _reach_cuts(results: RecordedResults, sizes: Sizes) -> Section:
    wide = results.by_level.pivot_table(index="noise_mm", columns="method", values="mean_ms")
    wide = wide[list(METHODS)].rename(columns=METHOD_NAMES).reset_index()
    best = results.by_level.pivot_table(index="noise_mm", columns="method", values="mean_ms").idxmin(axis=1)
    winners = listing(f"“{METHOD_NAMES[method]}” at {level:g} mm" for level, method in best.items())
    return Section(
        "Reaches between rests",
        (
            Prose(
                "Each of the 97 reaches is set between two rests of random length, and smooth noise is "
                "added to the whole; the first one is the reference. Smallest mean error of the cut points: "
                f"{winners}. A single quick reach between rests is the best case for the crossing alone, "
                "as long as the noise stays below its threshold; the alignment can do no better than two "
                "reaches of one person are alike."
            ),
            _figure(
                "reach_cuts",
                sizes,
                "Mean absolute error of the cut points over the added noise; bars: 95 % confidence "
                "interval over draws of rests and noise.",
                "Cut error of five methods over the noise level.",
            ),
            Table(
                wide,
                "Mean absolute cut error in ms.",
                formats=dict.fromkeys(METHOD_NAMES.values(), ".1f"),
                headings={"noise_mm": "noise (mm)"},
                source="tables/reach_cut_errors.csv",
            ),
        ),
    )


def _reaches(results: RecordedResults, sizes: Sizes) -> Section:
    return Section(
        "One primitive for 97 reaches",
        (
            Prose(
                "One position primitive is learned from all reaches in their local frames and unrolled "
                "with each reach's own start, goal and duration. The reaches lie "
                f"{results.own_spread_mm:.1f} mm from their own mean in local frame and normalised time, "
                "so this is the distance that no single movement can undercut by much."
            ),
            _figure(
                "reaches",
                sizes,
                "Grey: the reaches in their local frames, x from start to goal. Red: the primitive.",
                "Three local coordinates over normalised time, and a histogram of distances.",
            ),
            Table(
                results.reach_fit,
                "Distance between the reaches and the primitive; left out: ten at a time.",
                formats={"mean_mm": ".2f", "max_mm": ".1f", "end_max_mm": ".3f"},
                headings={
                    "mean_mm": "mean (mm)",
                    "max_mm": "largest (mm)",
                    "end_max_mm": "largest at the end (mm)",
                },
                source="tables/reach_reproduction.csv",
            ),
        ),
    )


def _unscrewing(results: RecordedResults, sizes: Sizes) -> Section:
    turns = results.unscrewing_errors["turn_deg"].iloc[:-1]
    return Section(
        "Unscrewing: nearly a full turn",
        (
            Prose(
                f"Three robot logs turn the hand by {turns.min():.0f} to {turns.max():.0f} degrees; two "
                "flip the sign of the quaternion on the way. The logarithm of the short way, on which the "
                "text's quaternion primitive runs, jumps at 180 degrees. Beyond 160 degrees of net turn "
                "the primitive runs in a twist-swing chart about the dominant axis instead."
            ),
            _figure(
                "unscrewing",
                sizes,
                "Grey: the logs in the chart, relative to their goals. Red: the primitive learned from all "
                "three.",
                "Twist and both swing coordinates over normalised time.",
            ),
            Table(
                results.unscrewing_errors,
                "A primitive from one log, unrolled with its start, goal and duration, against the log; "
                "the joint one, unrolled with the means, against the logs' time-normalised mean.",
                formats={"turn_deg": ".1f", "mean_deg": ".2f", "max_deg": ".2f", "end_deg": ".2f"},
                headings={
                    "learned_from": "learned from",
                    "compared_with": "compared with",
                    "turn_deg": "turn (°)",
                    "mean_deg": "mean (°)",
                    "max_deg": "largest (°)",
                    "end_deg": "at the end (°)",
                },
                source="tables/unscrewing.csv",
            ),
        ),
    )


def _execution(results: RecordedResults, sizes: Sizes) -> Section:
    blocks: list[Block] = [
        Prose(
            "One robot execution of the three scraping primitives on a tilted board. A primitive is "
            "learned from each part; they are unrolled in sequence, each from the state in which the one "
            "before it ended."
        ),
        _figure(
            "execution",
            sizes,
            "Recorded and unrolled position, and the distance in position and orientation. Lines: switches.",
            "Position over time and distances below.",
        ),
        Table(
            results.execution_errors,
            formats=dict.fromkeys(("mean_mm", "max_mm", "end_mm", "mean_deg", "max_deg", "end_deg"), ".2f"),
            headings={
                "mean_mm": "mean (mm)",
                "max_mm": "largest (mm)",
                "end_mm": "end (mm)",
                "mean_deg": "mean (°)",
                "max_deg": "largest (°)",
                "end_deg": "end (°)",
            },
            source="tables/execution.csv",
        ),
        Prose(
            "The 38 electrodes of two fingers are learned as sensor primitives on the same canonical "
            "systems. Most electrodes move by a few counts only, near the sensor's noise, so their NMSE "
            "is large while their error is below a count or two; those that move by more than "
            f"{STRONG_RANGE} counts show what the primitives can do."
        ),
        _figure(
            "electrodes",
            sizes,
            "Above: the electrodes that move most, recorded (grey) and as unrolled. Below: error of all.",
            "Traces of six electrodes in three primitives, error over range, histogram of errors.",
        ),
        Table(
            results.electrodes,
            "Sensor primitives of all 38 electrodes; the table of every electrode is in the CSV file.",
            formats={"rms": ".2f", "nmse": ".3f", "strong_nmse": ".3f"},
            headings={
                "rms": "median RMS (counts)",
                "nmse": "median NMSE",
                "strong": f"electrodes > {STRONG_RANGE} counts",
                "strong_nmse": "their mean NMSE",
            },
            source="tables/electrodes.csv",
        ),
    ]
    return Section("A recorded scraping execution", tuple(blocks))


def _slides(results: RecordedResults, sizes: Sizes) -> Section:
    by_group = results.slides.set_index("group")["median_rms"]
    ratio = by_group["other material"] / by_group["learned"]
    worst = results.slide_deviations.loc[results.slide_deviations["rms"].idxmax()]
    clock = results.clock_errors.assign(unit=results.clock_errors["kind"].map(UNITS))
    clock["kind"] = clock["kind"].str.replace("_", " ")
    return Section(
        "Slides: expected traces and deviations",
        (
            Prose(
                "Six streams per trial, each with its own irregular clock, are put on one clock by linear "
                "interpolation. What that costs is measured: every second sample of a stream is predicted "
                "from its neighbours. The gaps bridged there are twice the real ones, so the errors are "
                "upper bounds, and the sensor's own noise is in them."
            ),
            Table(
                clock,
                "Error of the common clock, held-out samples.",
                formats={
                    "median_gap_ms": ".1f",
                    "longest_gap_ms": ".0f",
                    "rms_error": ".2g",
                    "max_error": ".2g",
                },
                headings={
                    "kind": "stream",
                    "median_gap_ms": "median gap (ms)",
                    "longest_gap_ms": "longest gap (ms)",
                    "rms_error": "RMS error",
                    "max_error": "largest error",
                },
                source="tables/slide_clock.csv",
            ),
            Prose(
                "Expected traces of 19 electrodes come from "
                f"{(results.slide_deviations['group'] == 'learned').sum()} trials of one material. The "
                f"median deviation on the other material is {ratio:.1f} times that of the trials learned "
                f"from. The largest deviation, {worst['largest']:.0f} counts, is that of "
                f"{worst['demonstration']} ({worst['group']})"
                + (
                    ": in it several electrodes jump for a tenth of a second, a fault of the sensor."
                    if worst["group"] == "left out"
                    else "."
                )
            ),
            _figure(
                "slides",
                sizes,
                "Above: deviation from the expected traces, mean and standard deviation over trials, for the "
                "electrodes that vary most. Below: every trial.",
                "Deviations over time of three electrodes, and a bar per trial.",
            ),
            Table(
                results.slides,
                "Root mean square deviation over all electrodes and times, in counts.",
                formats={"median_rms": ".2f", "largest_rms": ".2f"},
                headings={"median_rms": "median over trials", "largest_rms": "largest"},
                source="tables/slide_deviations.csv",
            ),
        ),
    )


def _files(parameters: Mapping[str, Parameters], recordings: tuple[Link, ...]) -> Section:
    sources = (
        "Sources: github.com/gsutanto/dmp (MIT licence) and github.com/dexrob/BioTac_slide_20_50 (no licence "
        "stated; not redistributed here). Every imported file carries source, commit, licence and checksum."
    )
    return Section(
        capitalised("files and parameters"),
        (
            Prose("Open a recording with `rerun FILE`."),
            Links(recordings),
            Prose(sources),
            Links((Link("metrics.json", "metrics.json", "the key figures"),)),
            parameter_table(parameters),
        ),
    )
