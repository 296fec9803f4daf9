"""The page of the recorded data: its figures, and the sentences that its numbers say."""

from collections.abc import Mapping

from matplotlib.figure import Figure as Picture

from structlearn.ground.params import Parameters
from structlearn.reporting import segmentation_figures
from structlearn.reporting.page import (
    HOW_TO_OPEN,
    Block,
    KeyNumber,
    Link,
    Links,
    Page,
    Prose,
    Section,
    Sizes,
    Table,
    beside,
)
from structlearn.reporting.parameter_table import parameter_table
from structlearn.reporting.prose import listing
from structlearn.reporting.segmentation_figures import METHOD_NAMES
from structlearn.segmentation.method_comparison import paired_comparison
from structlearn.segmentation.result import METHODS
from structlearn.testbeds.recorded.page import (
    recorded_avoidance,
    recorded_corrections,
    recorded_dynamics,
    recorded_figures,
    recorded_latent_touch,
)
from structlearn.testbeds.recorded.page.recorded_results import STRONG_RANGE, RecordedResults, metrics

SENSOR_FAULT = 1000
"""Counts; touch changes an electrode by some hundreds, see the scraping execution."""

UNITS = {
    "pose": "m",
    "joint_positions": "rad",
    "joint_velocities": "rad/s",
    "joint_torques": "N m",
    "wrench": "N, N m",
    "tactile": "counts",
}


def pictures(results: RecordedResults) -> dict[str, Picture]:
    """All figures of the page by name."""
    paths = [orientation for _, orientation in results.unscrewing_segments]
    return {
        "reach_cuts": segmentation_figures.noise_figure(
            results.by_level, paired_comparison(results.by_seed), "noise added (mm)", "same draw"
        ),
        "reaches": recorded_figures.reaches_figure(
            results.reach_segments, results.reach_primitive, results.reach_errors
        ),
        **recorded_corrections.pictures(results.corrections),
        "unscrewing": recorded_figures.unscrewing_figure(paths, results.unscrewing_primitive.orientation),
        "execution": recorded_figures.execution_figure(results.execution, results.execution_path),
        "electrodes": recorded_figures.electrodes_figure(results.electrode_traces, results.electrode_scores),
        "slides": recorded_figures.slides_figure(results.slide_statistics, results.slide_deviations),
        **recorded_avoidance.pictures(results.avoidance),
        **recorded_latent_touch.pictures(results.latent_touch),
        **recorded_dynamics.pictures(results.dynamics),
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
            "fingers, of a tactile finger that slides over two materials, of people who "
            "reach past obstacles, and of a robot arm on an exciting trajectory. Nothing on this page is "
            "simulated but the rests and the noise that are added to the reaches to know where they begin "
            "and end, and the touches that recorded ones are set beside."
        ),
        key_numbers=(
            KeyNumber(
                f"{values['reach_cut_error_ms_2mm']:.0f} ms", "mean cut error of reaches with 2 mm of noise"
            ),
            KeyNumber(
                f"{values['reach_fit_mean_mm']:.1f} mm", "mean distance of one primitive from 97 reaches"
            ),
            KeyNumber(
                f"{values['coupling_path_mean_mm']:.0f} mm",
                f"from higher reaches with learned coupling; without {values['nominal_path_mean_mm']:.0f} mm",
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
            recorded_corrections.section(results.corrections, sizes),
            _unscrewing(results, sizes),
            _execution(results, sizes),
            _slides(results, sizes),
            recorded_avoidance.section(results.avoidance, sizes),
            recorded_latent_touch.section(results.latent_touch, sizes),
            recorded_dynamics.section(results.dynamics, results.slide_torques, results.slide_payloads, sizes),
            _files(parameters, recordings),
        ),
        back=Link("../index.html", "All testbeds"),
    )


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
            beside(
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
            beside(
                "reaches",
                sizes,
                "Grey: the reaches in their local frames, x from start to goal. Red: the primitive.",
                "Three local coordinates over normalised time, and a histogram of distances.",
            ),
            Table(
                results.reach_fit,
                "Distance between the reaches and the primitive; left out: ten at a time. Scaled: the "
                "forcing term along the reach grows with its length, so that a longer reach ends at its "
                "goal on time.",
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
            beside(
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
        beside(
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
        beside(
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
                    "rms_error": ".3g",
                    "max_error": ".4g",
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
                    ": far beyond any touch, a fault of the sensor."
                    if worst["largest"] > SENSOR_FAULT
                    else "."
                )
            ),
            beside(
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
        "Sources: github.com/gsutanto/dmp (MIT licence), github.com/marcocognetti/FrankaEmikaPandaDynModel "
        "(GPL-3.0) and github.com/dexrob/BioTac_slide_20_50 (no licence stated), neither of which is "
        "redistributed here. Every imported file carries source, commit, licence and checksum."
    )
    return Section(
        "Files and parameters",
        (
            Prose(HOW_TO_OPEN),
            Links(recordings),
            Prose(sources),
            Links((Link("metrics.json", "metrics.json", "the key figures"),)),
            parameter_table(parameters),
        ),
    )
