"""What was found on the UR10e, by the names that `ur10e_claims.yaml` uses."""

from collections.abc import Mapping

import numpy as np

from structlearn.reporting.claims import Evidence, Found, counted, exact, unknown
from structlearn.rigid_body.model_names import STRICT
from structlearn.testbeds.recorded import names
from structlearn.testbeds.recorded.page.parts.panda_part import TEXT_STRUCTURES
from structlearn.testbeds.recorded.page.parts.ur10e_results import (
    BEST,
    BOUNDS,
    FEWEST_BLOCKS,
    Drawn,
    Ur10eResults,
    chosen,
)

RIVALS = (("mlp", "none"), ("mlp_scaled", "none"), ("delan", "viscous"))

NO_LOAD = unknown("no motion is recorded with and without a load")


def ur10e_evidence(results: Ur10eResults) -> dict[str, Found]:
    """By the names of the claims."""
    return _models(results) | _drives(results) | _load(results) | _written(results)


def _cases(drawn: Mapping[str, Drawn]) -> dict[str, Evidence]:
    """Intervals that hold together."""
    return {name: one.evidence(len(drawn)) for name, one in drawn.items()}


def _joint_names(results: Ur10eResults) -> list[str]:
    return [f"joint {joint}" for joint in results.joints]


def _models(results: Ur10eResults) -> dict[str, Found]:
    test, part = results.test, results.parameters.test
    structures = [(model, "viscous") for model in TEXT_STRUCTURES]
    better = test.loc[structures].max() < test.loc["urdf", "none"]
    joints = _joint_names(results)
    levels = {key: results.nmse(part, key) for key in (*structures, *RIVALS, BEST, BOUNDS)}
    worst = max(structures, key=lambda key: levels[key][0].mean())

    def apart(key: tuple[str, str]) -> Drawn:
        (value, draws, count), (other, others, _) = levels[key], levels[worst]
        return Drawn(value.mean() - other.mean(), (draws - others).mean(axis=1), count)

    def ratio(model: str) -> Drawn:
        (value, draws, count), (other, others, _) = (
            results.nmse(part, (model, friction)) for friction in ("viscous", "coulomb")
        )
        return Drawn(value.mean() / other.mean(), draws.mean(axis=1) / others.mean(axis=1), count)

    (own, own_draws, count), (bound, bound_draws, _) = levels[BEST], levels[BOUNDS]
    level = [
        Drawn(value, draws, count)
        for value, draws in zip(own / bound, (own_draws / bound_draws).T, strict=True)
    ]
    further = {
        f"{log}: {joint}": found
        for log in results.further
        for joint, found in zip(joints, results.joint_error(log), strict=True)
        if found.n >= FEWEST_BLOCKS
    }
    return {
        "better_joints": counted(int(better.sum()), len(better)),
        "over_networks": _cases({names.DYNAMICS_MODELS[key[0]]: apart(key) for key in RIVALS}),
        "coulomb_factor": _cases({names.DYNAMICS_MODELS[model]: ratio(model) for model in STRICT}),
        "errors": _cases(dict(zip(joints, results.joint_error(part), strict=True))),
        "further_errors": _cases(further) or unknown("no further motion is long enough"),
        "level": _cases(dict(zip(joints, level, strict=True))),
    }


def _drives(results: Ur10eResults) -> dict[str, Found]:
    train, gains = results.parameters.train, results["gains"].set_index("joint")
    delays = {f"joint {joint}": results.drive("delay", train, joint, 1e3) for joint in results.joints}
    assumed = {}
    for joint in gains.index[gains["assumed"]]:
        moving, stands_in = results.drive("gain in motion", train, joint), gains.loc[joint, "found"]
        assumed[f"joint {joint}"] = Drawn(
            100.0 * (moving.value / stands_in - 1.0), 100.0 * (moving.draws / stands_in - 1.0), moving.n
        )
    return {
        "delays": _cases(delays),
        "assumed_gains": _cases(assumed) or unknown("every gain is found at rest, or none is"),
    }


def _load(results: Ur10eResults) -> dict[str, Found]:
    found = chosen(results["loads"], gains="found")["pair"].tolist()
    alone = {pair: results.load(pair, "found") for pair in found if pair in results.load_logs}
    carried = {log: results.carried_error(log) for log in results.load_logs}
    long = {log: its for log, its in carried.items() if its.n >= FEWEST_BLOCKS}
    together = "all pairs" in found
    return {
        "load": results.load("all pairs", "found").evidence() if together else NO_LOAD,
        "load_alone": _cases(alone) or NO_LOAD,
        "load_quoted": results.load("all pairs", "quoted").evidence() if together else NO_LOAD,
        "load_carried": _cases(long) or unknown("nowhere is the load carried long enough"),
    }


def _written(results: Ur10eResults) -> dict[str, Found]:
    differences = results["written"]["difference_n_m"].to_numpy()
    links = chosen(results["links"], model=BEST[0], friction=BEST[1])
    possible = links[["positive_mass", "positive_definite", "triangle"]].all(axis=1)
    return {
        "written_torques": exact(np.max(differences), len(differences)),
        "possible_bodies": counted(int(possible.sum()), len(possible)),
    }
