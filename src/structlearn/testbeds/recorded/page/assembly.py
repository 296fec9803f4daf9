"""The page of the recorded data put together: what its template names, claims with verdicts, sources."""

from collections.abc import Mapping
from importlib.resources import files as package_files

import numpy as np
import yaml

from structlearn.ground.params import Parameters
from structlearn.palette import METHOD_NAMES
from structlearn.recordings.clmc import INCOMPLETE_REACHES
from structlearn.reporting.claims import judge, read_claims
from structlearn.reporting.document import Document, Source, Table, environment
from structlearn.reporting.prose import listing, rounded
from structlearn.testbeds.recorded import names
from structlearn.testbeds.recorded.files import TABLES
from structlearn.testbeds.recorded.page.evidence import evidence
from structlearn.testbeds.recorded.page.results import (
    STRONG_RANGE,
    RecordedResults,
    best_representation,
    by_axis,
    likeness,
    metrics,
    panda_errors,
)
from structlearn.testbeds.recorded.protocol.corrected_reaches import DATASET

PACKAGE = __package__

HEADLINES = (
    "reach_cut_error_ms_2mm",
    "reach_left_ten_out_mean_mm",
    "nominal_path_mean_mm",
    "coupling_path_mean_mm",
    "unscrewing_mean_deg_joint",
    "scraping_prim3_mean_mm",
    "obstacle_nmse_x",
    "touch_reconstruction_nmse_slides",
    "touch_reconstruction_nmse_simulated_to_slides",
    "panda_nmse_mlp",
    "panda_nmse_cov_viscous",
    "panda_nmse_cov_coulomb",
)
"""The metrics that stand for all others."""


def recorded_document(
    results: RecordedResults, tables: Mapping[str, Table], parameters: Mapping[str, Parameters]
) -> Document:
    """The page; parameters by their key in `params.yaml`."""
    known = facts(results)
    claims = read_claims(package_files(PACKAGE) / "claims.yaml")
    return Document(
        template="recorded.html.jinja",
        package=PACKAGE,
        stage="stages/recorded/dvc.yaml:report",
        facts=known,
        tables=tables,
        judged=judge(claims, evidence(results), environment(PACKAGE), known),
        sources={name: source(path) for name, path in TABLES.items()},
        parameters=parameters,
        recordings="../recordings/recorded",
    )


def source(path: str, stage: str = "") -> Source:
    """Of a table of the recorded data; the stage has the folder's name where none is given."""
    return Source(f"data/recorded/{path}.parquet", f"stages/recorded/dvc.yaml:{stage or path.split('/')[0]}")


def published() -> dict[str, float]:
    """What the dissertation prints."""
    return yaml.safe_load((package_files(PACKAGE) / "published.yaml").read_text(encoding="utf-8"))


def facts(results: RecordedResults) -> dict[str, object]:
    """Numbers and small phrases by name: all metrics, and what else the sentences say."""
    turns = results["unscrewing_errors"]
    turns = turns.loc[turns["learned_from"] != "all", "turn_deg"]
    deviations, groups = results["slide_deviations"], results.slides.set_index("group")
    left_out = results["slide_left_one_out"]
    targets = results["coupling_scores"].groupby("axis")
    return metrics(results) | {
        "published": published(),
        "reach_count": len(results.reach_segments),
        "winners": _winners(results),
        "incomplete": len(INCOMPLETE_REACHES[DATASET]),
        "splits": results["coupling_distances"]["split"].nunique(),
        "poor_axes": listing(targets["nmse"].mean().loc[lambda error: error >= 1.0].index, "no axis"),
        "target_end_percent": 100 * targets["target_end_share"].mean().max(),
        "least_turn": turns.min(),
        "most_turn": turns.max(),
        "strong_range": STRONG_RANGE,
        "slide_groups": groups.to_dict("index"),
        "slides_by_material": dict(iter(left_out.groupby("material"))),
        "own_slides": left_out[left_out["material"] == results.slide_material],
        "worst_slide": deviations.loc[deviations["rms"].idxmax()].to_dict(),
        **_avoidance_facts(results),
        **_touch_facts(results),
        **_panda_facts(results),
    }


def _winners(results: RecordedResults) -> str:
    """`“zero-velocity crossing” at 0 mm and ...`: the method of the smallest mean error by noise."""
    best = results.by_level.pivot_table(index="noise_mm", columns="method", values="mean_ms").idxmin(axis=1)
    return listing(f"“{METHOD_NAMES[method]}” at {level:g} mm" for level, method in best.items())


def _avoidance_facts(results: RecordedResults) -> dict[str, object]:
    scores, gains = (
        by_axis(results[f"avoidance_{table}"], column)
        for table, column in (("scores", "nmse"), ("phase", "gain"))
    )
    name, inputs = best_representation(results)
    return {
        "representation_count": len(scores),
        "block_count": results["avoidance_folds"]["fold"].nunique(),
        "best_name": names.REPRESENTATIONS[name],
        "best_sees": names.INPUTS[inputs].name,
        "avoidance_nmse": {
            name: listed(scores.loc[name, "features"]) for name in names.REPRESENTATIONS if name != "pmnn"
        },
        "best_nmse": listed(scores.loc[name, inputs]),
        "velocity_gain": listed(gains.loc["ensemble", "phase_velocity"]),
        "linear_gain": listed(gains.loc["ridge", "phase"]),
    }


def _touch_facts(results: RecordedResults) -> dict[str, object]:
    scores = results.touch_scores
    components = "3 principal components"
    new_sets = scores["reconstruction"].xs("new set", level="new")
    origin, target, model = new_sets.idxmin()
    own = scores["reconstruction"][target, target, "new trials", model]
    linear = {
        name: its.droplevel([0, 1, 2]).idxmin() == components
        for name, its in scores["reconstruction"]
        .xs("new trials", level="new", drop_level=False)
        .groupby(level=1)
    }

    def touch(first: str, second: str, new: str, *models: str) -> str:
        """Reconstruction errors by some models, default all."""
        return listing(
            rounded(scores["reconstruction"][first, second, new, one], ".2f")
            for one in models or names.TOUCH_MODELS
        )

    def touch_error(error: str) -> str:
        """Of the structured latent space on new trials of slides, unscrewing and simulated touch."""
        sets = ("slides", "unscrewing", "simulated")
        return listing(rounded(scores[error][name, name, "new trials", "structured"], ".2f") for name in sets)

    return {
        "touch": touch,
        "touch_error": touch_error,
        "touch_sets": results["touch_sets"].set_index("set").to_dict("index"),
        "pairs": ("structured", components),
        "only_simulated_needs_network": (linear["slides"], linear["unscrewing"], linear["simulated"])
        == (True, True, False),
        "chance": 1 - 3 / results["touch_correlations"]["electrode"].nunique(),
        "carried_from": origin,
        "carried_to": target,
        "carried_by": names.TOUCH_MODELS[model].name,
        "carried_percent": 100 * (1 - new_sets.min()) / (1 - own),
        "likeness": lambda first, second: likeness(results, first, second),
    }


def _panda_facts(results: RecordedResults) -> dict[str, object]:
    test, train = (panda_errors(results, part).mean(axis=1) for part in ("test", "train"))
    by_joint = results.panda.loc["cov", "viscous"] / results.panda.loc["cov", "coulomb"]
    torques, payloads = results["slide_torques"], results["slide_payloads"].set_index("sign")
    left = torques[torques["payload"]].groupby("sign")["left_n_m"].max()
    keys = (
        ("mlp", "none"),
        ("mlp_scaled", "none"),
        ("delan", "viscous"),
        ("delan", "coulomb"),
        ("cov", "coulomb"),
    )
    return {
        "trained_and_tested": [
            f"{names.DYNAMICS_MODELS[key[0]]}{' + Coulomb' if key[1] == 'coulomb' else ''} "
            f"{train[key]:.2g} \N{RIGHTWARDS ARROW} {test[key]:.2g}"
            for key in keys
            if key in test.index
        ],
        "friction_factor": by_joint,
        "left_turned": left[-1],
        "left_as_recorded": left[1],
        "mass_turned": payloads.loc[-1, "mass_kg"],
        "mass_as_recorded": payloads.loc[1, "mass_kg"],
    }


def listed(values: np.ndarray) -> str:
    """`0.18, 0.24, 0.36`: along x, y and z."""
    return ", ".join(rounded(value, ".2f") for value in values)
