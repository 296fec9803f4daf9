"""A small refinement in memory, and all that the report rests on, for its tests."""

import runpy
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from functools import cache
from itertools import product

import numpy as np
import pandas as pd
from committed import ROOT, committed
from reporting_feedback import ADAPTED, SEEN, execution, feedback_stages
from reporting_scraping import FIT, PARAMETERS, cut_stages, demonstration, grid

from dissertation.evidence.studies import OURS, Study
from dissertation.scraping.page.findings import PUBLISHED
from dissertation.scraping.page.stored import Stored
from dissertation.scraping.protocol import results
from dissertation.scraping.protocol.board_refinement import BoardRefinementParameters
from dissertation.scraping.protocol.execution_scores import AFTER, BEFORE, NOMINAL
from dissertation.scraping.protocol.sample_efficiency import CMA_ES, PI2
from dissertation.scraping.world.layout import CONTACT_M
from structlearn.feedback.coupling_targets import SupervisionParameters
from structlearn.policy_search.refinement import FEEDBACK, IMPROVED, SAMPLE
from structlearn.readers.demonstration import Demonstration

LISTED = runpy.run_path(str(ROOT / "stages/scraping/report.py"))["PARAMETERS"]
REFINED_DEG = 10.0
LEARNED = (5.0, 7.5)
SETTINGS = (0.0, 5.0, 7.5, 8.8, 10.0)
RUNS = 4
SAMPLES = 6
CORRECTED = {NOMINAL: 0.0, BEFORE: 6.0, AFTER: 9.0}
"""Degrees by which the hand turns at 10 degrees."""

COSTS = {
    NOMINAL: dict(zip(SETTINGS, (2.0, 90.0, 140.0, 165.0, 190.0), strict=True)),
    BEFORE: dict(zip(SETTINGS, (9.0, 30.0, 40.0, 60.0, 80.0), strict=True)),
    AFTER: dict(zip(SETTINGS, (8.0, 29.0, 35.0, 38.0, 42.0), strict=True)),
}
"""Accumulated cost in rad by model and setting."""

CURVES = {"turn": (80.0, 50.0, 42.0, 42.0), "scrape": (80.0, 60.0, 42.0, 42.0)}
"""Mean cost with the network in rad after every iteration."""


def parameters(primitives: Sequence[str] = ADAPTED, **changes: object) -> BoardRefinementParameters:
    values = {
        "settings_deg": LEARNED,
        "setting_deg": REFINED_DEG,
        "exploration": dict.fromkeys(primitives, 15.0),
        "iterations": 3,
        "evaluation_runs": RUNS,
    }
    return committed(BoardRefinementParameters, "refine", **(values | changes))


def history(
    curves: Mapping[str, Sequence[float]] = CURVES, faults: Mapping[int, str] = {}, runs: int = RUNS
) -> pd.DataFrame:
    """Runs with the network as the curves, samples above, improved policies below; faults by sample."""
    rng = np.random.default_rng(5)
    rows = []
    for primitive, costs in curves.items():
        person = 3.0 * rng.normal(size=runs)  # of the conditions: equal in all iterations
        for iteration, cost in enumerate(costs):
            groups = {}
            if iteration:
                groups = {SAMPLE: cost + 20.0 * rng.random(SAMPLES), IMPROVED: cost - 2.0 - rng.random(2)}
            groups[FEEDBACK] = cost + person + 0.3 * rng.normal(size=runs)
            for kind, values in groups.items():
                for number, value in enumerate(values):
                    fault = faults.get(number, "") if kind == SAMPLE else ""
                    known = np.nan if fault else value
                    rows.append((primitive, iteration, kind, number, known, known / 20.0, fault))
    columns = ["primitive", "iteration", "kind", "number", "cost_rad", "norm_rad", "fault"]
    return pd.DataFrame(rows, columns=columns)


def scores(
    costs: Mapping[str, Mapping[float, float]] = COSTS, settings: Sequence[float] = SETTINGS, runs: int = RUNS
) -> pd.DataFrame:
    """Executions whose costs differ between runs by more than between models, so that pairs matter."""
    rng = np.random.default_rng(6)
    shared = rng.normal(size=(len(settings), runs, 1))  # of the conditions
    names = [f"{run + 1:02d}" for run in range(runs)]
    table = grid(model=(NOMINAL, BEFORE, AFTER), setting_deg=settings, run=names, primitive=ADAPTED)
    mean = [
        costs[model][setting] for model, setting in zip(table["model"], table["setting_deg"], strict=True)
    ]
    noise = 0.05 * rng.normal(size=(3, len(settings), runs, len(ADAPTED)))
    return table.assign(cost_rad=mean + (shared + noise).ravel())


def search(ends: Mapping[str, float], seeds: int = 3) -> pd.DataFrame:
    """Searches that go from 80 rad to `ends` by method; seeds differ by 1 rad at the end."""
    rows = []
    for primitive, (method, per_update), seed in product(ADAPTED, ((PI2, 38), (CMA_ES, 13)), range(seeds)):
        updates = 114 // per_update
        for update in range(updates + 1):
            cost = 80.0 + (ends[method] + seed - 80.0) * update / updates
            best = cost - 5.0 if update else np.nan
            keys = (primitive, method, seed, update, update * per_update)
            rows.append((*keys, cost, best, int(update > 1)))
    columns = ["primitive", "method", "seed", "update", "rollouts", "cost_rad", "best_rad", "failed"]
    return pd.DataFrame(rows, columns=columns)


def examples() -> dict[str, list]:
    """Executions at 10 degrees whose tool turns with the hand, the edge where it meets the board."""
    made = {}
    for model, turned in CORRECTED.items():
        own = [execution(seed, REFINED_DEG, corrected=turned) for seed in range(1, RUNS + 1)]
        made[model] = [replace(run, position=run.position + CONTACT_M) for run in own]
    return made


def corrections() -> dict[float, list[Demonstration]]:
    """Corrections at 10 degrees; the n-th is n tenths of a second later and leaves n tenths of a degree."""
    runs = [execution(n, REFINED_DEG, corrected=REFINED_DEG - 0.1 * n) for n in range(1, RUNS + 1)]
    return {
        REFINED_DEG: [
            replace(run, orientation=np.roll(run.orientation, round(0.1 * n / run.dt), axis=0))
            for n, run in enumerate(runs, 1)
        ]
    }


def refinement_stages() -> tuple[dict[str, object], dict[str, pd.DataFrame]]:
    """What the refinement's stages would have written, if everything is as the dissertation says."""
    searched = search({PI2: 45.0, CMA_ES: 55.0})
    return {"refined": examples()}, {"refined_scores": scores(), "history": history(), "search": searched}


@cache
def every_stage() -> Stored:
    """Outputs of all stages, and the parameters that they would have had."""
    own = {
        "segment": PARAMETERS.model_copy(update={"skip_failures": True}),
        "fit_primitives": FIT,
        "refine": parameters(),
        "coupling_dataset": committed(SupervisionParameters, "coupling_dataset", settings_deg=SEEN),
    }
    listed = {key: committed(model, key) for page in LISTED.values() for key, model in page.items()}
    stages = cut_stages([demonstration(seed) for seed in range(3)]), feedback_stages(), refinement_stages()
    own_fields = {name: part for parts, _ in stages for name, part in parts.items()}
    tables = {name: table for _, its in stages for name, table in its.items()}
    return Stored(parameters=listed | own, tables=tables, **own_fields)


def stored(**changes: object) -> Stored:
    """The same with other tables, or other fields."""
    names = {one.name for one in fields(Stored)}
    tables = {name: table for name, table in changes.items() if name not in names}
    own = {name: part for name, part in changes.items() if name in names}
    return replace(every_stage(), tables=every_stage().tables | tables, **own)


PERSON, SWEPT = 9, range(3)


def results_of(its: Stored, *pages: str) -> pd.DataFrame:
    """Table of results of these outputs, of some pages or of all."""
    parameters, tables = its.parameters, its.tables
    parts = {
        "segmentation": lambda: [
            results.of_person(PERSON, its.demonstrations, its.segmentation, corrections(), its.unrolls),
            results.of_cuts(its.demonstrations, its.segmentation, parameters["segment"].primitives),
            results.of_primitives(tables, parameters["fit_primitives"].regression),
        ],
        "feedback": lambda: [
            results.of_models(tables, its.networks),
            results.of_executions(tables, its.datasets, parameters["testbed"].control.force_n),
        ],
        "refinement": lambda: [
            results.of_refinement(tables, parameters["refine"]),
            results.of_searches(tables),
        ],
    }
    chosen = [part for page in pages or parts for part in parts[page]()]
    sweep = results.of_sweep(tables) if "segmentation" in (pages or parts) else []
    return results.scraping_results(PERSON, chosen, sweep)


def people(
    ours: pd.DataFrame, published: pd.DataFrame | None = None, count: int = 5, spread: float = 0.01
) -> Study:
    """A study of people whose results differ by a little from given ones, in both forms."""
    rng, parts = np.random.default_rng(5), []
    for variant, table in ((OURS, ours), (PUBLISHED, ours if published is None else published)):
        own = table[table["person"] == PERSON]
        for person in range(11, 11 + count):
            values = own["value"] * (1.0 + spread * rng.normal(size=len(own)))
            parts.append(own.assign(value=values, person=person, variant=variant, cell=str(person)))
    return Study(pd.concat(parts, ignore_index=True))
