"""The page that sets simulated touch beside recorded touch, and says what agrees and what does not."""

from collections.abc import Mapping

import pandas as pd
from matplotlib.figure import Figure as Picture

from structlearn.ground.params import Parameters
from structlearn.reporting.page import KeyNumber, Link, Links, Page, Prose, Section, Sizes, Table, beside
from structlearn.reporting.parameter_table import parameter_table
from structlearn.reporting.prose import listing
from structlearn.testbeds.recorded.page import calibration_figures
from structlearn.testbeds.recorded.page.calibration_results import STATISTICS, CalibrationResults
from structlearn.testbeds.recorded.protocol.touch_calibration import (
    REFERENCE,
    SIMULATED,
    CalibrationParameters,
)

SOURCES = (
    "Recorded: one execution of the three scraping primitives with two fingers, three logs of unscrewing "
    "with one finger (github.com/gsutanto/dmp, MIT licence), and slides of one finger over two materials "
    "(github.com/dexrob/BioTac_slide_20_50). Simulated: nominal executions of the same three primitives by "
    "the robot of the scraping testbed on a level board."
)


def pictures(results: CalibrationResults, parameters: CalibrationParameters) -> dict[str, Picture]:
    """All figures of the page by name."""
    return {
        "traces": calibration_figures.traces_figure(results.traces),
        "electrodes": calibration_figures.electrodes_figure(results.electrodes),
        "spectra": calibration_figures.spectra_figure(results.spectra),
        "components": calibration_figures.components_figure(results.components, parameters.variance),
    }


def calibration_page(
    results: CalibrationResults, sizes: Sizes, key: str, parameters: CalibrationParameters
) -> Page:
    """The page; figures are expected as `figures/NAME.png`, tables as `tables/NAME.csv`.

    Args:
        results: see there.
        sizes: of the figures.
        key: of the parameters in `params.yaml`.
        parameters: of the comparison.
    """
    by_name = results.comparison.set_index("statistic")
    runs = results.fingers[results.fingers["group"] == SIMULATED]["run"].nunique()
    return Page(
        title="Simulated touch beside recorded touch",
        lead=(
            "The feedback models learn from the counts of two simulated fingers. This page measures the same "
            "statistics on those counts and on public recordings of the real sensor. Constants of the "
            "simulated one were chosen by hand while looking at the recorded scraping execution: at the "
            "changes by contact, the ranges afterwards and the noise, not at spectra and dimensions."
        ),
        key_numbers=(
            KeyNumber(
                f"{int(by_name['agrees'].sum())} of {len(by_name)}",
                f"statistics agree within a factor of {parameters.factor:g}",
            ),
            _beside(by_name, "contact_strongest", ".0f", "counts by contact, strongest electrode"),
            _beside(by_name, "noise_median", ".2f", "counts of noise, median electrode"),
            _beside(by_name, "pca_dimensions", ".3g", "principal components of a finger"),
        ),
        sections=(
            _statistics(results, parameters, runs),
            _traces(results, sizes),
            _electrodes(sizes),
            _spectra(by_name, sizes),
            _components(by_name, sizes, parameters),
            _files({key: parameters}),
        ),
        back=Link("../index.html", "All testbeds"),
    )


def _beside(by_name: pd.DataFrame, name: str, number_format: str, label: str) -> KeyNumber:
    recorded, simulated = by_name.loc[name, "recorded"], by_name.loc[name, "simulated"]
    return KeyNumber(
        f"{recorded:{number_format}} | {simulated:{number_format}}", f"{label}: recorded | simulated"
    )


def _statistics(results: CalibrationResults, parameters: CalibrationParameters, runs: int) -> Section:
    table = results.comparison
    named = table.assign(statistic=table["statistic"].map(STATISTICS))
    agree, differ = named[named["agrees"]], named[~named["agrees"]]
    worst = "; ".join(
        f"{row.statistic}: {row.recorded:.3g} recorded, {row.simulated:.3g} simulated"
        for row in differ.itertuples()
    )
    headings = {
        "recorded_low": "from",
        "recorded_high": "to",
        "simulated_low": "from",
        "simulated_high": "to",
        "ratio": "simulated / recorded",
    }
    medians = results.medians.assign(statistic=results.medians["statistic"].map(STATISTICS))
    return Section(
        "The same statistics of both",
        (
            Prose(
                f"One recorded execution (two fingers) against {runs} simulated ones. Every number is of one "
                "finger; the median over runs and fingers counts, with the range. Two medians agree if they "
                f"are within a factor of {parameters.factor:g}: one recorded execution of one robot with its "
                "own tool and its own two sensors bears no finer test. Contact: how far contact with the "
                "board moved an electrode. Range: how far it moved afterwards. Active: those with a range of "
                f"more than {parameters.active_counts:g} counts."
            ),
            Table(
                named,
                "Recorded beside simulated (simulated: this project's model of fingers and contact).",
                formats=dict.fromkeys(
                    (
                        "recorded",
                        "recorded_low",
                        "recorded_high",
                        "simulated",
                        "simulated_low",
                        "simulated_high",
                    ),
                    ".3g",
                )
                | {"ratio": ".2f"},
                headings=headings,
                source="tables/comparison.csv",
            ),
            Prose(
                f"{len(agree)} statistics agree. "
                + (f"These do not: {worst}." if len(differ) else "None lies outside.")
            ),
            Table(
                medians,
                "Medians of all sets. Unscrewing and slides are other tasks under other forces: they show "
                "how far real touch goes, the simulation is not meant to match them.",
                formats=dict.fromkeys(results.groups, ".4g"),
                source="tables/fingers.csv",
            ),
        ),
        simulated=True,
    )


def _traces(results: CalibrationResults, sizes: Sizes) -> Section:
    strongest = {
        group: listing(
            f"{int(row.electrode)} ({row.finger}, {row.contact:+.0f})".replace("-", "\N{MINUS SIGN}")
            for row in results.strongest(group).itertuples()
        )
        for group in (REFERENCE, SIMULATED)
    }
    return Section(
        "One run of each",
        (
            Prose(
                "The first primitive makes the contact with the board, which stands from the dotted line on; "
                "then the tool turns, then it scrapes. Contact moves these electrodes most: recorded "
                f"{strongest[REFERENCE]}; simulated {strongest[SIMULATED]}. Which electrodes those are is "
                "not fitted and does not agree: the recorded ones are opposite corners at the sides of the "
                "pads, as if a flat handle twisted on them; a simulated pad has one round moving contact. "
                "The sign of the counts is a matter of the sensor's electronics; amplitudes are compared."
            ),
            beside(
                "traces",
                sizes,
                "Left: recorded. Right: simulated. The four electrodes of a finger that move most have a "
                "colour, all others are grey.",
                "Counts of two fingers over time, recorded and simulated.",
            ),
        ),
        simulated=True,
    )


def _electrodes(sizes: Sizes) -> Section:
    return Section(
        "Amplitudes and noise",
        (
            beside(
                "electrodes",
                sizes,
                "Left and middle: the electrodes of every finger in falling order, one line per run and "
                "finger. Right: noise, from second differences in the median half second, rounding included.",
                "Sorted changes by contact, sorted ranges, and distribution of noise.",
            ),
        ),
        simulated=True,
    )


def _spectra(by_name: pd.DataFrame, sizes: Sizes) -> Section:
    middle = by_name.loc["power_middle"]
    return Section(
        "Spectra",
        (
            Prose(
                "Between 2 and 10 Hz the strongest electrode of a finger moves by "
                f"{middle['recorded']:.3g} counts in the recording and by {middle['simulated']:.3g} in the "
                "simulation. In the recording both fingers move together there while the tool scrapes or "
                "travels, and hardly while it stands on the board: this is the tool's vibration, not the "
                "sensor's noise."
            ),
            beside(
                "spectra",
                sizes,
                "Power density in contact (Welch), median over runs and fingers.",
                "Spectra of the strongest and the median electrode, recorded and simulated.",
            ),
        ),
        simulated=True,
    )


def _components(by_name: pd.DataFrame, sizes: Sizes, parameters: CalibrationParameters) -> Section:
    its = by_name.loc["pca_dimensions"]
    return Section(
        "Dimensions",
        (
            Prose(
                f"To hold {100 * parameters.variance:g} % of the variance in contact takes "
                f"{_span(its, 'recorded')} principal components of a finger in the recording and "
                f"{_span(its, 'simulated')} in the simulation. "
                "In a finger that hardly moves, noise is a large part of the variance, and each electrode's "
                "is a component of its own, so that this number says as much about noise as about touch; the "
                "curve below tells them apart. The dissertation's 7 and 6 dimensions are of deviations over "
                "many settings of the board, not of one execution."
            ),
            beside(
                "components",
                sizes,
                "Variance left after the first principal components of a finger's 19 electrodes, median over "
                f"runs and fingers; dotted: {100 * (1 - parameters.variance):g} %.",
                "Variance left over the number of components, recorded and simulated.",
            ),
        ),
        simulated=True,
    )


def _span(row: pd.Series, which: str) -> str:
    """`2`, or `2 to 11`: range of a statistic over runs and fingers."""
    low, high = row[f"{which}_low"], row[f"{which}_high"]
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _files(parameters: Mapping[str, Parameters]) -> Section:
    return Section(
        "Files and parameters",
        (
            Prose(SOURCES),
            Links((Link("metrics.json", "metrics.json", "the key figures"),)),
            parameter_table(parameters),
        ),
    )
