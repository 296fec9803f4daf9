"""The scraping report: its pages with figures, tables and metrics."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from structlearn.core.artefacts import Metrics
from structlearn.core.params import read_values
from structlearn.feedback.feedback_models import POINTWISE
from structlearn.primitives.kernels import KERNEL_COUNT
from structlearn.reporting import movement_figures, segmentation_figures
from structlearn.reporting.claims import UNKNOWN, Found, judge, quoted, read_claims
from structlearn.reporting.document import Document, Source, Table, environment
from structlearn.reporting.figure_style import Drawing, Raster
from structlearn.reporting.prose import listing
from structlearn.reporting.studies import Study, rests_on
from structlearn.segmentation.segments import commanded_cuts, read_segmentation
from structlearn.testbeds.scraping import files, names
from structlearn.testbeds.scraping.page import (
    demonstration_figures,
    feedback_figures,
    people_results,
    refinement_figures,
    refinement_results,
    tables,
)
from structlearn.testbeds.scraping.page.feedback_results import BoardResults, FeedbackResults
from structlearn.testbeds.scraping.page.refinement_results import RefinementResults
from structlearn.testbeds.scraping.page.segmentation_results import SegmentationResults
from structlearn.testbeds.scraping.protocol.execution_scores import AFTER, BEFORE, NOMINAL
from structlearn.testbeds.scraping.world.scene_still import scraping_still

Drawings = dict[str, Drawing | Sequence[Drawing]]
PACKAGE = "structlearn.testbeds.scraping.page"
STAGE = "scraping_report"
PAGES = {"index": "Segmentation and primitives", "feedback": "Feedback", "refinement": "Refinement by trial"}
"""Title by file name."""

PARAMETERS = {
    "index": ("clock", "simulate", "segment", "segment_sweep", "fit_primitives", "generalise"),
    "feedback": (
        *("scraping_people", "testbed", "expected_traces", "record_corrections", "coupling_dataset"),
        *("train_feedback", "compare_models", "evaluate_feedback"),
    ),
    "refinement": ("refine", "evaluate_refinement", "compare_search"),
}
"""By page, keys of `params.yaml` that its results were made with."""

SOURCES = {
    "demonstrations": Source("data/runs/scraping/nominal.parquet", "scraping_import_nominal"),
    "segments": Source("data/segments/scraping", "scraping_segment"),
    "sweep": Source("data/segments/scraping_sweep", "scraping_sweep"),
    "primitives": Source("data/primitives/scraping", "scraping_fit_primitives"),
    "expected": Source("data/feedback/scraping/expected", "scraping_expected_traces"),
    "dataset": Source("data/feedback/scraping/dataset", "scraping_coupling_dataset"),
    "models": Source("data/feedback/scraping/models", "scraping_train_feedback"),
    "comparison": Source("data/feedback/scraping/comparison", "scraping_compare_models"),
    "closed_loop": Source("data/runs/scraping/closed_loop", "scraping_evaluate_feedback"),
    "corrections": Source("data/runs/scraping/corrections", "scraping_import_corrections"),
    "evaluation": Source("data/feedback/scraping/evaluation", "scraping_evaluate_feedback"),
    "refinement": Source("data/feedback/scraping/refinement", "scraping_refine"),
    "refined": Source("data/feedback/scraping/refined", "scraping_evaluate_refinement"),
    "search": Source("data/feedback/scraping/search", "scraping_compare_search"),
}
"""Files that figures and tables come from, with the stages that make them."""

HEADLINES = (
    *("demonstrations", "simulated", "cut_error_ms_wls", "left_one_out_down_mean_mm"),
    *("pmnn_prim2_generalization_nmse_best_step", "pmnn_prim3_generalization_nmse_best_step"),
    *("cost_ratio_feedback_over_nominal_0", "cost_ratio_feedback_over_nominal_10"),
    *("rl_cost_before_prim2", "rl_cost_after_prim2", "rl_cost_before_prim3", "rl_cost_after_prim3"),
)


@dataclass
class ScrapingReport:
    """What `publishing.publish_report` takes."""

    pages: dict[str, Document] = field(default_factory=dict)
    drawings: Drawings = field(default_factory=dict)
    tables: dict[str, Table] = field(default_factory=dict)
    metrics: Metrics = field(default_factory=dict)

    @property
    def headlines(self) -> list[str]:
        """Those of `HEADLINES` that are known."""
        return [name for name in HEADLINES if name in self.metrics]


def published() -> Mapping[str, object]:
    """What the dissertation prints for this testbed."""
    return read_values(Path(__file__).with_name("published.yaml"))


def scraping_report(
    segmentation: SegmentationResults,
    feedback: FeedbackResults,
    refinement: RefinementResults,
    studies: Mapping[str, Study | None],
    parameters: Mapping[str, Any],
) -> ScrapingReport:
    """The report.

    `studies`: all of `refinement_results.STUDIES` by name; None where not run with these parameters.
    `parameters`: all of `PARAMETERS` by key.
    """
    report, printed = ScrapingReport(), published()
    primitives = [primitive.name for primitive in segmentation.primitives]
    people_study = studies.get(people_results.STUDY)
    studied = people_results.People.of_study(people_study, primitives) if people_study is not None else None
    shown_one = people_results.People.of_one(report.metrics, primitives)
    basis = rests_on(people_results.STUDY, people_study)
    shared = {
        "pages": PAGES,
        "published": printed,
        "params": parameters,
        "results": segmentation,
        "feedback": feedback,
        "refinement": refinement,
        "primitives": primitives,
        "names": names,
        "people": studied,
        "kernel_count": KERNEL_COUNT,
        "over_people": "n people, each with a sensor of their own, on whom nothing was tuned.",
        "degrees": lambda settings: listing(f"{setting:g}°" for setting in settings),
    }

    def add(page: str, found: Mapping[str, Found], shown: Mapping[str, Found] | None = None) -> None:
        claims = read_claims(Path(__file__).with_name(f"{page.replace('index', 'segmentation')}_claims.yaml"))
        claims = people_results.beside(claims, shown or {}, parameters["scraping_people"].shown)
        whole: dict[str, Found] = {claim.evidence: UNKNOWN for claim in claims}
        whole |= found
        facts = shared | {"page": page, "evidence": whole}
        report.pages[page] = Document(
            template=f"{page.replace('index', 'segmentation')}.html.jinja",
            package=PACKAGE,
            stage=STAGE,
            facts=facts,
            tables=report.tables,
            judged=judge(claims, whole, environment(PACKAGE), facts),
            sources=SOURCES,
            parameters={key: parameters[key] for key in PARAMETERS[page]},
            recordings="../rerun/scraping",
            simulated=True,
            basis=basis,
        )

    report.drawings |= segmentation_drawings(segmentation)
    report.tables |= tables.segmentation_tables(segmentation)
    report.metrics |= segmentation.metrics()
    aligned = [primitive.name for primitive in segmentation.found_primitives]
    found = people_results.known(people_results.segmentation_evidence, studied, aligned)
    of_one = people_results.known(people_results.segmentation_evidence, shown_one, aligned)
    found = quoted(found, people_results.STUDY)
    add("index", found | people_results.sweep_evidence(segmentation), of_one)

    report.drawings |= feedback_drawings(feedback, studied)
    report.tables |= tables.feedback_tables(feedback, printed)
    report.metrics |= feedback.metrics()
    report.metrics |= people_results.known(people_results.summary, studied)
    settings = feedback.board.settings_deg
    found, of_one = (
        people_results.known(people_results.feedback_evidence, one, feedback.adapted, settings)
        for one in (studied, shown_one)
    )
    beside = {name: one for name, one in of_one.items() if not name.endswith(people_results.VALIDATED)}
    add("feedback", quoted(found, people_results.STUDY), beside)

    report.drawings |= refinement_drawings(refinement, primitives)
    report.tables |= tables.refinement_tables(refinement, primitives, printed)
    numbers = {name: primitives.index(name) + 1 for name in primitives}
    refined = {name: numbers[name] for name in refinement.refined}
    report.tables |= refinement_results.study_tables(studies, refined)
    report.metrics |= refinement.metrics(numbers.__getitem__)
    report.metrics |= refinement_results.population_metrics(studies, list(refined.values()))
    found = refinement_results.refinement_evidence(refinement, studies, numbers.__getitem__)
    add("refinement", quoted(found, refinement_results.PEOPLE))
    return report


def segmentation_drawings(results: SegmentationResults) -> Drawings:
    """Figures of the page on segmentation and primitives, as far as the data go."""
    made: Drawings = {
        "demonstrations": demonstration_figures.demonstrations_figure(results),
        "one_demonstration": demonstration_figures.one_demonstration_figure(
            results.example, results.segmentation
        ),
        "space": demonstration_figures.space_figure(results),
        "downsampling": segmentation_figures.downsampling_figure(results.downsampling),
        "position_fit": demonstration_figures.position_fit_figure(results),
        "forcing": demonstration_figures.forcing_figure(results),
        "sequence": movement_figures.sequence_figure(results.sequences),
        "sequence_space": demonstration_figures.sequence_space_figure(results.sequences),
        "noise_sweep": segmentation_figures.noise_figure(results.sweep, results.sweep_comparison),
        "orientation_fit": demonstration_figures.orientation_fit_figure(results),
    }
    if results.guesses:
        first = results.found_primitives[0]
        guess = results.most_refined_guess(first.name)
        made["correspondences"] = segmentation_figures.correspondence_figure(
            results.reference, guess, results.segmentation, first
        )
        made["alignment"] = segmentation_figures.alignment_figure(
            results.was_cut, results.segmentation, results.found_primitives
        )
    return made


def feedback_drawings(results: FeedbackResults, studied: people_results.People | None) -> Drawings:
    """Figures of the page on feedback models; two of them show the people studied."""
    board, known = results.board, (*results.seen_deg, 0.0)
    made: Drawings = {
        "expected_traces": feedback_figures.expected_figure(results),
        "coupling_targets": feedback_figures.targets_figure(results),
        "models": feedback_figures.models_figure(results, studied),
        "weights": feedback_figures.weights_figure(results),
        "still": scraping_still(board.examples[POINTWISE][0], board.example_deg),
        "executions": feedback_figures.executions_figure(board, results.primitives),
        "board_roll": feedback_figures.roll_figure(results),
        "board_cost": feedback_figures.cost_figure(
            board, results.primitives, lambda setting: "" if setting in known else "unseen", studied
        ),
    }
    for name in results.adapted:
        panels = feedback_figures.closed_loop_figure(results, name)
        made[f"closed_loop_{name}"] = [Raster(panel) for panel in panels]  # lines by the hundred
    return made


def refinement_drawings(results: RefinementResults, primitives: list[str]) -> Drawings:
    """Figures of the page on refinement by trial, as far as the data go."""
    made: Drawings = {
        "refinement_learning": refinement_figures.learning_figure(results, primitives),
        "refinement_cost": feedback_figures.cost_figure(results, primitives, results.role),
    }
    if results.evaluated:
        made["refinement_snapshots"] = refinement_figures.snapshots_figure(results, primitives)
    if results.searched_primitives:
        made["search_efficiency"] = refinement_figures.search_figure(results, primitives)
    return made


def read_results(
    found: files.ScrapingFiles, parameters: Mapping[str, Any]
) -> tuple[SegmentationResults, FeedbackResults, RefinementResults]:
    """Outputs of the stages."""
    primitives = found.primitives()
    segmentation = SegmentationResults(
        demonstrations=found.runs("nominal"),
        segmentation=read_segmentation(found.segments),
        noise=found.table("noise"),
        downsampling=found.table("downsampling"),
        downsampling_people=found.table("downsampling_people"),
        primitives=primitives,
        reproduction=found.table("reproduction"),
        nominal=found.table("nominal"),
        generalised=found.table("generalised"),
        segment_parameters=parameters["segment"],
        fit_parameters=parameters["fit_primitives"],
    )
    own = [primitive.name for primitive in primitives]
    return segmentation, read_feedback(found, own, parameters), read_refinement(found, parameters)


def read_feedback(
    found: files.ScrapingFiles, primitives: list[str], parameters: Mapping[str, Any]
) -> FeedbackResults:
    """What the feedback stages wrote."""
    unrolls, datasets = found.runs("unrolls"), found.datasets()
    return FeedbackResults(
        primitives=primitives,
        unrolls=unrolls,
        unroll_cuts=commanded_cuts(unrolls, primitives),
        expected=found.expected(),
        datasets=datasets,
        checks={name: found.checks(name) for name in datasets},
        networks=found.networks(POINTWISE),
        comparison=found.table("comparison"),
        orderings=found.table("orderings"),
        seen_deg=parameters["coupling_dataset"].settings_deg,
        board=_board(found, parameters),
    )


def _board(found: files.ScrapingFiles, parameters: Mapping[str, Any]) -> BoardResults:
    """What was executed on the board."""
    largest = max(parameters["evaluate_feedback"].settings_deg)
    return BoardResults(
        scores=found.table("scores"),
        traces=found.table("traces"),
        path_errors=found.table("path_errors"),
        examples={model: found.runs_at(largest, files.CLOSED_LOOP, model) for model in (NOMINAL, POINTWISE)},
        corrected=found.runs_at(largest, files.CORRECTIONS),
        example_deg=largest,
        axis=parameters["coupling_dataset"].unit_axis,
        force_n=parameters["testbed"].control.force_n,
    )


def read_refinement(found: files.ScrapingFiles, parameters: Mapping[str, Any]) -> RefinementResults:
    """What the stages of the refinement wrote."""
    tilt = parameters["refine"].setting_deg
    examples = {model: found.runs_at(tilt, files.REFINED, model) for model in (NOMINAL, BEFORE, AFTER)}
    return RefinementResults(
        scores=found.table("refined_scores"),
        examples={model: runs for model, runs in examples.items() if runs},
        example_deg=tilt,
        axis=parameters["coupling_dataset"].unit_axis,
        history=found.table("history"),
        search=found.table("search"),
        parameters=parameters["refine"],
    )
