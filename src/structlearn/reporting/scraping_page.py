"""The page of the scraping testbed: its figures, and its sections in order."""

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure as Picture

from structlearn.params import Parameters
from structlearn.reporting import (
    demonstration_figures,
    primitive_figures,
    scraping_cutting,
    scraping_movement,
    segmentation_figures,
)
from structlearn.reporting.page import HOW_TO_OPEN, Block, KeyNumber, Link, Links, Page, Prose, Section, Sizes
from structlearn.reporting.parameter_table import parameter_table
from structlearn.reporting.scraping_claims import claims
from structlearn.reporting.scraping_results import ScrapingResults
from structlearn.segmentation.result import RESULT


def pictures(results: ScrapingResults) -> dict[str, Picture]:
    """All figures of the page by name, as far as the data go."""
    dt = results.reference.dt
    made = {
        "demonstrations": demonstration_figures.demonstrations_figure(
            results.demonstrations, results.reference.name
        ),
        "one_demonstration": demonstration_figures.one_demonstration_figure(
            results.example, results.segmentation
        ),
        "space": demonstration_figures.space_figure(results.was_cut, results.segmentation),
        "downsampling": segmentation_figures.downsampling_figure(results.downsampling),
        "position_fit": primitive_figures.position_fit_figure(results.primitives, results.segments, dt),
        "forcing": primitive_figures.forcing_figure(results.primitives),
        "sequence": primitive_figures.sequence_figure(results.sequences),
        "sequence_space": primitive_figures.sequence_space_figure(results.sequences),
    }
    if len(results.sweep):
        made["noise_sweep"] = segmentation_figures.noise_figure(results.sweep, results.sweep_comparison)
    if results.guesses:
        first = results.found_primitives[0]
        made["correspondences"] = segmentation_figures.correspondence_figure(
            results.reference, results.most_refined_guess(first.name), results.segmentation, first
        )
        made["alignment"] = segmentation_figures.alignment_figure(
            results.was_cut, results.segmentation, results.found_primitives
        )
    if results.has_orientation:
        made["orientation_fit"] = primitive_figures.orientation_fit_figure(
            results.primitives, results.segments, dt
        )
    return made


def scraping_page(
    results: ScrapingResults,
    sizes: Sizes,
    parameters: Mapping[str, Parameters],
    recordings: Sequence[Link] = (),
) -> Page:
    """The page; figures are expected as `figures/NAME.png`, tables as `tables/NAME.csv`.

    Args:
        results: what to show.
        sizes: of the figures of `pictures`.
        parameters: by their key in `params.yaml`.
        recordings: links to .rrd files.
    """
    sections = [
        scraping_movement.recorded(results, sizes),
        claims(results),
        scraping_cutting.correspondences(results, sizes) if results.guesses else None,
        scraping_cutting.alignment(results, sizes),
        scraping_cutting.noise(results, sizes) if len(results.sweep) else None,
        scraping_cutting.downsampling(results, sizes),
        scraping_movement.primitives(results, sizes),
        scraping_movement.sequence(results, sizes),
        _files(parameters, recordings),
    ]
    return Page(
        title="Scraping: from demonstrations to a sequence of primitives",
        lead=(
            "A person shows the scraping task several times. The demonstrations are cut into primitives by "
            "aligning them, each primitive is learned from its segments, and the primitives are executed as "
            "one movement. Dissertation, sections IV.3, IV.5 and IV.9.2."
        ),
        key_numbers=tuple(_key_numbers(results)),
        sections=tuple(section for section in sections if section is not None),
        simulated=results.simulated,
        back=Link("../index.html", "All testbeds"),
    )


def _key_numbers(results: ScrapingResults) -> list[KeyNumber]:
    numbers = [KeyNumber(str(len(results.was_cut)), "demonstrations cut into primitives")]
    if results.errors_of_cuts is not None:
        error = results.errors_of_cuts.set_index("method").loc[RESULT, "mean_ms"]
        numbers.append(KeyNumber(f"{error:.0f} ms", f"mean error of a cut point; {_length(results)}"))
    chosen = results.fit[results.fit["regression"] == results.fit_parameters.regression]
    new = chosen[chosen["left_out"]]
    shown, of = (new, "that were left out") if len(new) else (chosen, "it learned from")
    numbers.append(
        KeyNumber(
            f"{shown['mean_mm'].max():.1f} mm",
            f"largest mean distance of a primitive from demonstrations {of}",
        )
    )
    if "mean_deg" in shown:
        numbers.append(KeyNumber(f"{shown['mean_deg'].max():.1f}°", "the same for orientation"))
    if results.acceleration_jumps:
        jump = max(results.acceleration_jumps.values())
        numbers.append(KeyNumber(f"{100 * jump:.1g} %", "largest jump of the acceleration at a switch"))
    return numbers


def _length(results: ScrapingResults) -> str:
    cuts = results.segmentation.cuts
    chosen = cuts[cuts["method"] == RESULT]
    found = chosen[chosen["primitive"].isin([primitive.name for primitive in results.found_primitives])]
    return f"segments last {(found['end_s'] - found['start_s']).mean():.1f} s"


def _files(parameters: Mapping[str, Parameters], recordings: Sequence[Link]) -> Section:
    blocks: list[Block] = []
    if recordings:
        blocks += [Prose(HOW_TO_OPEN), Links(tuple(recordings))]
    blocks += [
        Prose("All numbers on this page are in these files, or follow from the tables beside the figures."),
        Links(
            (
                Link("metrics.json", "metrics.json", "the key figures, for `dvc metrics show`"),
                Link("tables/cut_points.csv", "tables/cut_points.csv", "every cut point, by every method"),
            )
        ),
        parameter_table(parameters),
    ]
    return Section("Files and parameters", tuple(blocks))
