"""What was found on recorded data, by the names that `claims.yaml` uses."""

import numpy as np
import pandas as pd

from structlearn.ground.metrics import mean_interval
from structlearn.reporting.claims import (
    UNKNOWN,
    Evidence,
    Found,
    by_case,
    counted,
    difference,
    exact,
    geometric_mean,
    mean,
)
from structlearn.rigid_body.model_names import STRICT
from structlearn.testbeds.recorded import names
from structlearn.testbeds.recorded.page.results import AXES, RecordedResults, best_representation, by_axis

TEXT_STRUCTURES = ("symm", *STRICT)
"""Structures that table III.2 has."""

CONSISTENT = ("tri", "cov")
"""Structures of bodies that can exist."""


def evidence(results: RecordedResults) -> dict[str, Found]:
    """By the names of the claims."""
    return _reaches(results) | _movements(results) | _avoidance(results) | _touch(results) | _panda(results)


def _reaches(results: RecordedResults) -> dict[str, Found]:
    errors = {
        name: its.set_index("demonstration") for name, its in results["reach_errors"].groupby("variant")
    }
    learned = errors["learned from"].index
    left_out = errors.get("left out", errors["learned from"][:0])["mean_mm"]
    ends_mm = errors["learned from, forcing not scaled"]["end_mm"].reindex(learned)
    lengths_mm = [
        1e3 * np.linalg.norm(path.position[-1] - path.position[0]) for path, _ in results.reach_segments
    ]
    from_mean = pd.Series(results.own_distances_mm, learned)
    return {
        "printed_over_crossing": cut_gains(results, "zvc", "wls_text"),
        "printed_over_least_squares": cut_gains(results, "ls", "wls_text"),
        "ours_over_crossing": cut_gains(results, "zvc", "wls"),
        "ours_over_warping": cut_gains(results, "dtw", "wls"),
        "reach_ends": exact((100 * ends_mm / lengths_mm).max(), len(ends_mm)),
        "reaches_left_out": mean((left_out - from_mean).dropna()),
    }


def cut_gains(results: RecordedResults, first: str, second: str) -> dict[str, Evidence]:
    """Cut error in ms of one method minus that of another, by noise; pairs are reaches, averaged over draws.

    The draws of rests and noise are not independent evidence: without noise they hardly differ.
    """
    table = results["cut_errors"]
    both_ends = 1e3 * table[["start_error_s", "end_error_s"]].abs().mean(axis=1)
    wide = table.assign(error_ms=both_ends).pivot_table(
        index=["noise_mm", "demonstration"], columns="method", values="error_ms"
    )
    wide = wide.dropna(subset=[first, second])
    return {
        f"{level:g} mm": difference(its[first], its[second]) for level, its in wide.groupby(level="noise_mm")
    }


def _movements(results: RecordedResults) -> dict[str, Found]:
    by_reach = results.distances_by_reach
    turns = results["unscrewing_errors"]
    single, joint = turns[turns["learned_from"] != "all"], turns[turns["learned_from"] == "all"]
    parts = results["sequence_errors"]
    others = results["slide_deviations"].query("group == 'other material'")["rms"].to_numpy()
    left_out = results["slide_left_one_out"]
    own = left_out[left_out["material"] == results.slide_material]
    return {
        "coupling_gain": difference(by_reach["nominal_mm"], by_reach["coupling_mm"]),
        "coupling_above_mean": difference(by_reach["coupling_mm"], by_reach["spread_mm"]),
        "coupling_end": mean(100 * by_reach["end_share"]),
        "turns": {
            "mean of a log": exact(single["mean_deg"].max(), len(single)),
            "mean of all": exact(joint["mean_deg"].max(), len(single)),
            "at the end": exact(turns["end_deg"].max(), len(turns)),
        },
        "sequence": {
            "position (mm)": exact(parts["mean_mm"].max(), len(parts)),
            "orientation (°)": exact(parts["mean_deg"].max(), len(parts)),
        },
        "electrodes": mean(results.strong_electrodes["nmse"]),
        "other_material": group_difference(others, own["rms"].to_numpy()),
        "slides_predicted": by_case(
            geometric_mean, {name: [its.to_numpy()] for name, its in left_out.groupby("material")["nmse"]}
        ),
    }


def group_difference(first: np.ndarray, second: np.ndarray) -> Evidence:
    """Mean of (N,) minus mean of (M,) samples that are no pairs, with Welch's interval."""
    from scipy import stats

    if min(len(first), len(second)) < 2:
        return UNKNOWN
    interval = stats.ttest_ind(first, second, equal_var=False).confidence_interval()
    return Evidence(first.mean() - second.mean(), interval.low, interval.high, len(first) + len(second))


def _avoidance(results: RecordedResults) -> dict[str, Found]:
    folds = results["avoidance_folds"].set_index(["representation", "inputs", "axis"])["nmse"].sort_index()

    def gains(first: tuple[str, str], second: tuple[str, str]) -> dict[str, Evidence]:
        return {f"along {axis}": difference(folds[(*first, axis)], folds[(*second, axis)]) for axis in AXES}

    best = best_representation(results)
    pooled = by_axis(results["avoidance_scores"], "nmse").loc[best]
    halves = {axis: mean_interval(folds[(*best, axis)].to_numpy())[1] for axis in AXES}
    count = results["avoidance_folds"]["fold"].nunique()
    return {
        "network_over_features": gains(("human_inspired", "features"), ("network_validation", "features")),
        "phase_to_network": gains(("network", "features"), ("network", "phase")),
        "modulation": gains(("network", "phase"), ("pmnn", "phase")),
        "phase_to_ensemble": gains(("ensemble", "features"), ("ensemble", "phase")),
        "best_representation": {
            f"along {axis}": Evidence(
                pooled[axis], pooled[axis] - halves[axis], pooled[axis] + halves[axis], count
            )
            for axis in AXES
        },
    }


def _touch(results: RecordedResults) -> dict[str, Found]:
    keys = ["learned_from", "asked_about", "new", "model"]
    by_question = dict(list(results["touch_errors"].groupby(keys)))

    def of(error: str, source: str, target: str, model: str = "structured") -> pd.Series:
        """By part that was left out, mean over seeds; by seed where nothing was left out."""
        its = by_question[source, target, "new trials" if source == target else "new set", model]
        return its.groupby("part" if len(set(its["part"])) > 1 else "seed")[error].mean()

    def gain(name: str) -> pd.Series:
        """Reconstruction error of principal components, which have no seeds, minus the latent space's."""
        own = of("reconstruction", name, name)
        rival = of("reconstruction", name, name, "3 principal components")
        return (rival if len(rival) == len(own) else rival.mean()) - own

    sets = ("slides", "unscrewing")
    carried = (("simulated, magnitudes", "slides"), ("simulated", "unscrewing"))
    return {
        "reconstruction": {name: mean(of("reconstruction", name, name)) for name in sets},
        "map_distances": {name: mean(of("distances", name, name)) for name in sets},
        "over_components": {name: mean(gain(name)) for name in (*sets, "simulated")},
        "carried_over": {target: mean(of("reconstruction", source, target)) for source, target in carried},
    }


def _panda(results: RecordedResults) -> dict[str, Found]:
    test = results.panda
    means = test.mean(axis=1)
    structures = [(model, "viscous") for model in TEXT_STRUCTURES]
    rows = results["panda_errors"][results["panda_errors"]["part"] == "test"]
    by_seed = rows.groupby(["model", "friction", "seed"])["nmse"].mean()
    better = test.loc[structures].max() < test.loc["urdf", "none"]
    last = test.columns[-1]
    with_coulomb = test.loc[[(model, "coulomb") for model in CONSISTENT]]
    return {
        "better_joints": counted(int(better.sum()), len(better)),
        "over_networks": {
            names.DYNAMICS_MODELS[key[0]]: mean(by_seed[key] - means[structures].max())
            for key in (("mlp", "none"), ("delan", "viscous"))
        },
        "coulomb_factor": {
            names.DYNAMICS_MODELS[model]: exact(
                means[model, "viscous"] / means[model, "coulomb"], len(better)
            )
            for model in STRICT
        },
        "over_least_squares": {
            names.FRICTIONS[friction]: exact(
                max(
                    (test.loc[model, friction] / test.loc["least_squares", friction]).max()
                    for model in CONSISTENT
                ),
                len(CONSISTENT) * len(better),
            )
            for friction in ("viscous", "coulomb", "offset")
            if ("least_squares", friction) in test.index
        },
        "coulomb_errors": {
            "joints 1 to 6": exact(with_coulomb.drop(columns=last).mean(axis=1).max(), len(CONSISTENT)),
            "joint 7": exact(with_coulomb[last].max(), len(CONSISTENT)),
        },
    }
