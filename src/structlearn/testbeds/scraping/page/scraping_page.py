"""The page of the scraping testbed: its figures, and its sections in order."""

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure as Picture

from structlearn.feedback.feedback_models import POINTWISE
from structlearn.ground.params import Parameters
from structlearn.reporting import segmentation_figures
from structlearn.reporting.page import HOW_TO_OPEN, Block, KeyNumber, Link, Links, Page, Prose, Section, Sizes
from structlearn.reporting.parameter_table import parameter_table
from structlearn.segmentation.result import RESULT
from structlearn.testbeds.scraping.page import (
    board_figures,
    board_sections,
    demonstration_figures,
    feedback_figures,
    feedback_sections,
    primitive_figures,
    refinement_sections,
    scraping_cutting,
    scraping_movement,
)
from structlearn.testbeds.scraping.page.feedback_results import FeedbackResults
from structlearn.testbeds.scraping.page.scraping_claims import claims
from structlearn.testbeds.scraping.page.scraping_results import ScrapingResults
from structlearn.testbeds.scraping.protocol.executed_sets import AFTER, BEFORE

TITLE = "Scraping: from demonstrations to a sequence of primitives"
LEAD = (
    "A person shows the scraping task several times. The demonstrations are cut into primitives by "
    "aligning them, each primitive is learned from its segments, and the primitives are executed as "
    "one movement. Dissertation, sections IV.3, IV.5 and IV.9.2."
)
TITLE_WITH_FEEDBACK = "Scraping: from demonstrations to feedback by touch"
LEAD_WITH_FEEDBACK = (
    "A person shows the scraping task several times. The demonstrations are cut into primitives, which a "
    "robot executes as one movement. Then the board tilts, people correct the robot, and a network learns "
    "to make the same corrections from what two fingers feel. Dissertation, sections IV.3, IV.5, IV.6 and "
    "IV.9.1 to IV.9.3."
)
LEAD_WITH_REFINEMENT = (
    "A person shows the scraping task several times. The demonstrations are cut into primitives, which a "
    "robot executes as one movement. Then the board tilts, people correct the robot, and a network learns "
    "to make the same corrections from what two fingers feel. On a tilt that such a network has not learned "
    "from, the robot refines it by trial and error. Dissertation, sections IV.3, IV.5 to IV.7 "
    "and IV.9."
)


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
    if results.feedback is not None:
        made |= _feedback_pictures(results.feedback)
    return made


def _feedback_pictures(feedback: FeedbackResults) -> dict[str, Picture]:
    made = {"expected_traces": feedback_figures.expected_figure(feedback)}
    if feedback.datasets:
        made["coupling_targets"] = feedback_figures.targets_figure(feedback)
    if len(feedback.comparison):
        made["models"] = feedback_figures.models_figure(feedback)
        made["weights"] = feedback_figures.weights_figure(feedback, feedback.adapted[0])
    if feedback.board is not None:
        made["executions"] = board_figures.executions_figure(feedback.board, feedback.primitives)
        for name in feedback.adapted:
            made[f"closed_loop_{name}"] = board_figures.closed_loop_figure(feedback, name)
        made["board_roll"] = board_figures.roll_figure(feedback)
        made["board_cost"] = board_figures.cost_figure(feedback)
    if feedback.refinement is not None:
        made |= refinement_sections.pictures(feedback)
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
        *(_feedback_sections(results.feedback, sizes) if results.feedback is not None else ()),
        _files(parameters, recordings),
    ]
    return Page(
        title=TITLE if results.feedback is None else TITLE_WITH_FEEDBACK,
        lead=_lead(results.feedback),
        key_numbers=tuple(_key_numbers(results)),
        sections=tuple(section for section in sections if section is not None),
        simulated=results.simulated,
        back=Link("../index.html", "All testbeds"),
    )


def _lead(feedback: FeedbackResults | None) -> str:
    if feedback is None:
        return LEAD
    return LEAD_WITH_FEEDBACK if feedback.refinement is None else LEAD_WITH_REFINEMENT


def _key_numbers(results: ScrapingResults) -> list[KeyNumber]:
    numbers = [KeyNumber(str(len(results.was_cut)), "demonstrations cut into primitives")]
    if results.errors_of_cuts is not None:
        error = results.errors_of_cuts.set_index("method").loc[RESULT, "mean_ms"]
        numbers.append(KeyNumber(f"{error:.0f} ms", f"mean error of a cut point; {_length(results)}"))
    chosen = results.fit[results.fit["regression"] == results.fit_parameters.regression]
    new = chosen[chosen["left_out"]]
    shown, of = (new, "that were left out") if len(new) else (chosen, "it learned from")
    turned = f"and {shown['mean_deg'].max():.1f}°: " if "mean_deg" in shown else ""
    numbers.append(
        KeyNumber(
            f"{shown['mean_mm'].max():.1f} mm",
            f"{turned}largest mean distance of a primitive from demonstrations {of}",
        )
    )
    if results.acceleration_jumps:
        jump = max(results.acceleration_jumps.values())
        numbers.append(KeyNumber(f"{100 * jump:.1g} %", "largest jump of the acceleration at a switch"))
    return [*numbers, *(_feedback_numbers(results.feedback) if results.feedback is not None else ())]


def _feedback_numbers(feedback: FeedbackResults) -> list[KeyNumber]:
    numbers = []
    if len(feedback.comparison):
        errors = [feedback.model_error(name, "pmnn_100")["generalization_mean"] for name in feedback.adapted]
        which = " | ".join(str(feedback.number(name)) for name in feedback.adapted)
        numbers.append(
            KeyNumber(
                " | ".join(f"{error:.2f}" for error in errors),
                f"generalisation NMSE of the feedback model, primitive {which}",
            )
        )
    if feedback.board is not None:
        largest = feedback.board.example_deg
        ratio = feedback.board.ratio(POINTWISE).loc[largest, "ratio"]
        numbers.append(
            KeyNumber(f"{100 * ratio:.0f} %", f"of the cost without feedback, with it, board at {largest:g}°")
        )
    refinement = feedback.refinement
    if refinement is not None and refinement.evaluated:
        tilt = refinement.example_deg
        ratios = [refinement.ratio(AFTER, BEFORE, name).loc[tilt, "ratio"] for name in refinement.refined]
        which = " | ".join(str(feedback.number(name)) for name in refinement.refined)
        numbers.append(
            KeyNumber(
                " | ".join(f"{100 * ratio:.0f}" for ratio in ratios) + " %",
                f"of the cost before refinement by trial, after it, board at {tilt:g}°, primitive {which}",
            )
        )
    return numbers


def _feedback_sections(feedback: FeedbackResults, sizes: Sizes) -> list[Section]:
    """Only those whose data there are: one can bring executions and corrections of one's own."""
    sections = []
    if feedback.board is not None:
        sections.append(board_sections.testbed(feedback, sizes))
    sections.append(feedback_sections.expected(feedback, sizes))
    if feedback.datasets:
        sections.append(feedback_sections.corrections(feedback, sizes))
    if len(feedback.comparison):
        sections.append(feedback_sections.models(feedback, sizes))
    if feedback.board is not None:
        sections.append(board_sections.closed_loop(feedback, sizes))
    if feedback.refinement is not None:
        sections.append(refinement_sections.refinement(feedback, sizes))
    return sections


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
