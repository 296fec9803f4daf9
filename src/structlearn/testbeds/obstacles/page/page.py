"""The page of the obstacle testbed: what its template and its claims name."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from structlearn.avoidance.learned_models import ENSEMBLE, HUMAN_INSPIRED, NETWORK
from structlearn.avoidance.shapes import SHAPES
from structlearn.core.params import read_values
from structlearn.reporting.claims import judge, read_claims
from structlearn.reporting.document import Document, Source, environment
from structlearn.reporting.findings import Findings
from structlearn.reporting.studies import provenance, read_study
from structlearn.testbeds.obstacles import files
from structlearn.testbeds.obstacles.page.findings import EVERY, FEW_HITS, ObstacleResults, example_setting
from structlearn.testbeds.obstacles.page.tables import tables
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import UNSEEN
from structlearn.testbeds.obstacles.world.reaching_person import DETOURS_M
from structlearn.testbeds.obstacles.world.scenarios import END_CLEARANCE_M

PACKAGE = "structlearn.testbeds.obstacles.page"
FOLDER = Path(__file__).parent

STUDIES = ("members", "displaced", "clearance")  # that the page quotes

SOURCES = {
    "recorded": Source(files.RUNS, "obstacles_demonstrate"),
    "people": Source(files.PEOPLE_FILE, "obstacles_dataset"),
    "errors": Source(files.ERRORS_FILE, "obstacles_train"),
    "scores": Source(files.SCORES_FILE, "obstacles_evaluate"),
    "paths": Source(files.PATHS_FILE, "obstacles_evaluate"),
}


def read_published() -> dict[str, Any]:
    """What the dissertation prints."""
    return read_values(FOLDER / "published.yaml")


def document(results: ObstacleResults, find: Findings) -> Document:
    """The page; figures are those of `figures.figures`."""
    published = read_published()
    shown = tables(results, published)
    limited = shown["limits"].frame
    named = facts(results, published) | find.numbers()
    named |= {
        "worst_goal": limited.loc[limited["goal_text"].idxmax()],
        "late_network": limited.loc[limited["model"].str.startswith(NETWORK), "late_goal_text"].max(),
    }
    return Document(
        template="obstacles.html.jinja",
        package=PACKAGE,
        stage="obstacles_report",
        facts=named,
        tables=shown,
        judged=judge(read_claims(FOLDER / "claims.yaml"), find, environment(PACKAGE), named),
        sources=SOURCES,
        parameters=results.parameters,
        recordings="../rerun/obstacles",
        simulated=any(one.simulated for its in results.demonstrations.values() for one in its),
    )


def facts(results: ObstacleResults, published: Mapping[str, Any]) -> dict[str, Any]:
    """What sentences name beside the findings: parameters, counts of the scene, and words."""
    spheres = results.situations[UNSEEN].obstacles[0]
    length = float(np.linalg.norm(results.baseline.goal - results.baseline.start))
    return {
        "published": published,
        "shapes": SHAPES,
        "few_hits": FEW_HITS,
        "shown": results.population.shown,
        "tuning": results.population.tuning,
        "setting": example_setting(results.scores, results.population.shown),
        "length": length,
        "longest_detour_m": DETOURS_M[-1],
        "end_clearance_m": END_CLEARANCE_M,
        **{key.removeprefix("obstacle_"): its for key, its in results.parameters.items()},
        "reaches": lambda protocol: len(results.rows(protocol)),
        "unseen_spheres": len(results.situations[UNSEEN].numbers),
        "outside": int(((spheres.centre[:, 0] < 0.0) | (spheres.centre[:, 0] > length)).sum()),
        "radius_mm": 1e3 * float(spheres.radius[0]),
        "most_hits": lambda protocol: max(
            results.hits(protocol, kind, source) for kind in (NETWORK, ENSEMBLE) for source in EVERY
        ),
        "rai_hits": lambda protocol: max(results.hits(protocol, HUMAN_INSPIRED, shape) for shape in SHAPES),
        "studies": {name: worst_hits(f"obstacles/{name}") for name in STUDIES},
    }


def worst_hits(study: str) -> str:
    """Results of a study, in words: by variant the most unseen spheres that anyone hits; whose code."""
    found = read_study(study)
    if found is None:
        return ""
    columns = [f"hits_unseen_{shape}_worst_person" for shape in SHAPES]
    means = found.table.groupby("variant", sort=False)[columns].mean().mean(axis=1)
    quoted = "; ".join(f"{variant}: {value:.1f}" for variant, value in means.items())
    return f"{quoted} ({provenance(found)})"
