"""The page of the obstacle testbed: what its template and its claims name."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from structlearn.avoidance.learned_models import ALL, HUMAN_INSPIRED, NETWORK, PHASE_MODULATED, SETTING
from structlearn.avoidance.shapes import SHAPES
from structlearn.reporting.claims import judge, read_claims
from structlearn.reporting.document import Document, Source, environment
from structlearn.testbeds.obstacles import files
from structlearn.testbeds.obstacles.page.evidence import evidence
from structlearn.testbeds.obstacles.page.results import ObstacleResults, example_setting, metrics
from structlearn.testbeds.obstacles.page.tables import FITS, tables
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import GOAL_CHANGE, TRAINED, UNSEEN
from structlearn.testbeds.obstacles.world.reaching_person import DETOURS_M
from structlearn.testbeds.obstacles.world.scenarios import END_CLEARANCE_M

PACKAGE = "structlearn.testbeds.obstacles.page"
FOLDER = Path(__file__).parent
NOTHING = pd.Series(dtype=float)

HEADLINES = (
    *("hits_trained_baseline", "hits_per_setting", "hits_unseen_baseline", "networks_per_shape"),
    *("hits_unseen_sphere", "hits_unseen_cube", "hits_unseen_cylinder", "hits_unseen_all"),
    *("nmse_test_sphere", "nmse_test_cube", "nmse_test_cylinder", "goal_distance_max_m"),
)
"""Metrics that `dvc metrics show` lists."""

SOURCES = {
    "recorded": Source(files.RAW, "obstacle_demonstrate"),
    "errors": Source(files.ERRORS_FILE, "obstacle_train"),
    "scores": Source(files.SCORES_FILE, "obstacle_evaluate"),
    "paths": Source(files.PATHS_FILE, "obstacle_evaluate"),
    "people": Source(files.PEOPLE_FILE, "obstacle_evaluate"),
}


def read_published() -> dict[str, Any]:
    """What the dissertation prints."""
    return yaml.safe_load((FOLDER / "published.yaml").read_text(encoding="utf-8"))


def document(results: ObstacleResults) -> Document:
    """The page; figures are those of `figures.figures`."""
    published = read_published()
    shown = tables(results, published)
    named = facts(results, published, {name: table.frame for name, table in shown.items()})
    claims = read_claims(FOLDER / "claims.yaml")
    return Document(
        template="obstacles.html.jinja",
        package=PACKAGE,
        stage="report_obstacles",
        facts=named,
        tables=shown,
        judged=judge(claims, evidence(results), environment(PACKAGE), named),
        sources=SOURCES,
        parameters=results.parameters,
        recordings="../recordings/obstacles",
        simulated=results.simulated,
    )


def facts(
    results: ObstacleResults, published: Mapping[str, Any], frames: Mapping[str, pd.DataFrame]
) -> dict[str, Any]:
    """What sentences name: the metrics, parameters, tables, and numbers that follow from them."""
    low = {
        column: {
            part: int(
                (results.setting_fits(column, part).get(NETWORK, NOTHING) <= published["largest_nmse"]).sum()
            )
            for part in ("train", "test")
        }
        for column in FITS
    }
    held_out = results.fits[(results.fits["learned_from"] == SETTING) & (results.fits["part"] == "test")]
    held_out = held_out[held_out["model"] == NETWORK]
    bare = results.rows(UNSEEN)
    nearest = {shape: results.rows(UNSEEN, NETWORK, shape)["obstacle_distance"].min() for shape in SHAPES}
    spheres = results.situations[UNSEEN].obstacles[0]
    length = float(np.linalg.norm(results.baseline.goal - results.baseline.start))
    limited = frames["limits"]
    return metrics(results) | {
        "published": published,
        "results": results,
        "networks": f"the mean of {results.members} networks" if results.members > 1 else "a single network",
        "shapes": SHAPES,
        "setting": example_setting(results.found.scores),
        "length": length,
        "longest_detour_m": DETOURS_M[-1],
        "end_clearance_m": END_CLEARANCE_M,
        **{key.removeprefix("obstacle_"): its for key, its in results.parameters.items()},
        "low": low,
        "dominant_error": held_out["nmse_dominant"].mean(),
        "other_error": held_out.loc[held_out["dominant"] == "", "nmse_across"].mean(),
        "x_error": held_out["nmse_x"].mean(),
        "per_setting": results.rows(TRAINED, NETWORK, SETTING),
        "people": results.found.people,
        "errors": {
            kind: {
                source: pd.DataFrame([results.fit(kind, source or shape, shape) for shape in SHAPES])
                for source in ("", ALL)
            }
            for kind in (NETWORK, PHASE_MODULATED)
        },
        "unseen_spheres": len(bare),
        "outside": int(((spheres.centre[:, 0] < 0.0) | (spheres.centre[:, 0] > length)).sum()),
        "radius_mm": 1e3 * float(spheres.radius[0]),
        "nearest": min(nearest.items(), key=lambda pair: pair[1]),
        "limits": limited,
        "worst_goal": limited.loc[limited["goal_text"].idxmax()],
        "late_network": limited.loc[limited["model"].str.startswith(NETWORK), "late_goal_text"].max(),
        "changed": limited[limited["hits_text"] != limited["hits_limited"]].to_dict("records"),
        "excursion": results.excursions.groupby(level=1).max(),
        "network_excursion": limited.loc[limited["model"].str.startswith(NETWORK), "excursion"].max(),
        "others_excursion_cm": 100 * results.excursions.drop(index=NETWORK, level=1).max(),
        "most_hits": lambda protocol: max(
            results.hits(protocol, kind, source)
            for kind in (NETWORK, PHASE_MODULATED)
            for source in (*SHAPES, ALL)
        ),
        "rai_hits": lambda protocol: [results.hits(protocol, HUMAN_INSPIRED, shape) for shape in SHAPES],
        "detour": lambda protocol, kind: results.detours.loc[(protocol, kind, ALL)],
        "short_mm": 1e3 * results.rows(GOAL_CHANGE)["goal_distance_m"].max(),
    }
