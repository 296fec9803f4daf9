"""Results on joint logs: errors by joint and model, drives and a load, each with its interval."""

from collections.abc import Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd

from structlearn.core.metrics import block_count, block_sums, drawn_counts, matching, percentiles
from structlearn.palette import BLACK, BLUE, GREEN, GREY, LIGHT_BLUE, OCHRE, ORANGE, PINK, Look
from structlearn.reporting.evidence import Evidence, Found, exact, exact_count, mean, unknown, within
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import interval, rounded
from structlearn.rigid_body import friction
from structlearn.rigid_body.model_names import DEFAULT, NAMES, STRICT
from structlearn.rigid_body.motion import drawn_nmse
from structlearn.tasks.motion import parameters as protocol
from structlearn.tasks.motion.differing_motion import ALL, LEARNED, REFITTED, REPEATABILITY
from structlearn.tasks.motion.parameters import SEED, MotionParameters

# The original URDF; the kind that becomes a URDF; the kind that need not be physically consistent
URDF, BEST, BOUNDS = ("urdf", "none"), "cov", "least_squares"
RIVALS = (("mlp", "none"), ("mlp_scaled", "none"), ("delan", "viscous"))
MODELS = {"urdf": NAMES[DEFAULT]} | NAMES | {BOUNDS: "least squares"}
FRICTIONS = {
    name: ", ".join(terms).replace("coulomb", "Coulomb") for name, terms in friction.FRICTIONS.items()
}
LOOKS = {  # models with their friction, keyed as in the protocol's tables
    URDF: Look(MODELS["urdf"], GREY),
    ("mlp", "none"): Look("MLP", ORANGE),
    ("mlp_scaled", "none"): Look("MLP, scaled", OCHRE),
    ("delan", "viscous"): Look("DeLaN", PINK),
    (BEST, "viscous"): Look("Cov, viscous", LIGHT_BLUE),
} | {
    (kind, term): Look(f"{words}, {FRICTIONS[term].removeprefix('viscous, ')}", black or colour)
    for kind, words, black in ((BEST, "Cov", ""), (BOUNDS, "least squares", BLACK))
    for term, colour in (("coulomb", BLUE), ("offset", GREEN), ("stiffness", OCHRE))
}
FEWEST_BLOCKS = 3  # an interval over fewer blocks is not reliable
HEADLINES = ("nmse", "nmse_urdf", "limit_percent", "relative_percent", "norm_n_m", "load_kg", "load_carried")
PERCENTS = ("load_alone", "load_quoted", "load_carried", "limit_percent", "relative_percent")
UNITS = dict.fromkeys(("assumed_gains", *PERCENTS), "%") | {
    "delays": "ms",
    "load_kg": "kg",
    "norm_n_m": "N m",
}
MISSING = dict.fromkeys(("over_networks", "over_networks_by_seed"), "no networks were trained") | {
    "assumed_gains": "every gain is found at rest, or none is",
    "load_carried": "nowhere is the load carried long enough",
}


class Drawn(NamedTuple):
    """A number with bootstrap draws (1 + D,), and the number of blocks drawn from."""

    samples: np.ndarray
    n: int

    @property
    def value(self) -> float:
        """The number on all blocks."""
        return float(self.samples[0])

    def over(self, reference: float) -> "Drawn":
        """Excess over a reference in percent."""
        return Drawn(100.0 / reference * self.samples - 100.0, self.n)

    def evidence(self, comparisons: int = 1) -> Evidence:
        """The number with its interval."""
        return within(self.value, partial(percentiles, self.samples[1:]), self.n, comparisons)

    def text(self, number: str) -> str:
        """The number with its interval as text, or `none`."""
        return "none" if np.isnan(self.value) else stated(self.evidence(), number)


Row = Drawn | Found | Mapping[str, Drawn]  # a finding before its intervals are computed


def stated(evidence: Evidence, number: str) -> str:
    """Number with its interval as text, e.g. `0.12 [0.1, 0.2]`."""
    return f"{rounded(evidence.value, number)} {interval(evidence.low, evidence.high, number)}"


def model_words(key: tuple[str, str]) -> str:
    """Display name of a model with friction, e.g. `Cov, viscous, Coulomb`."""
    return ", ".join(filter(None, (MODELS[key[0]], FRICTIONS[key[1]])))


class MotionResults(dict[str, pd.DataFrame]):
    """Tables of `learning.learn_motion`, keyed by name, with derived quantities."""

    def __init__(self, tables: Mapping[str, pd.DataFrame], parameters: MotionParameters) -> None:
        super().__init__(tables)
        self.parameters, its = parameters, parameters.judged_friction
        # the model that verdicts are about, and least squares with the same friction
        self.best, self.bounds = (BEST, its), (BOUNDS, its)
        # `train`, the part that verdicts are about, and others
        self.parts: list[str] = self["blocks"]["part"].unique().tolist()
        self.tested = self.parts[1]
        self.names, self.joints = (self["gravity"][column].tolist() for column in ("name", "joint"))
        self.train_log = str(self["motions"].query("learned_s > 0")["log"].iloc[0])  # the first of them
        self.carried_logs: list[str] = self["carried"]["log"].unique().tolist() if "carried" in self else []
        # by part: NMSE by model, friction and joint, mean over seeds
        keys, models, frictions = ["part", "model", "friction"], list(MODELS), list(FRICTIONS)
        wide = self["errors"].pivot_table(index=keys, columns="joint", values="nmse", sort=False)
        wide = wide.loc[sorted(wide.index, key=lambda key: (frictions.index(key[2]), models.index(key[1])))]
        self.errors = {part: wide.loc[part] for part in self.parts}
        self.test = self.errors[self.tested]
        # rms errors in N m on motion that differs, by joint, and by what was fitted to it
        self.losses = pd.DataFrame()
        if "differing" in self:
            self.losses = self["differing"].pivot_table("rmse_n_m", "joint", "fitted", sort=False)

    def nmse(self, part: str, model: tuple[str, str]) -> tuple[np.ndarray, int]:
        """NMSE (1 + D, n) of a model by joint, on a part and on drawn blocks, and the number of blocks."""
        blocks = matching(self["blocks"], part=part)
        value, draws, count = drawn_nmse(blocks, model, self.parameters.draws, SEED)
        return np.vstack([value, draws]), count

    def mean_nmse(self, model: tuple[str, str]) -> Drawn:
        """Mean NMSE over joints on the test part."""
        values, count = self.nmse(self.tested, model)
        return Drawn(values.mean(axis=1), count)

    def joint_nmse(self, part: str, model: tuple[str, str]) -> dict[str, Drawn]:
        """NMSE of a model by joint (`joint 1`, ...)."""
        values, count = self.nmse(part, model)
        return {
            f"joint {joint}": Drawn(column, count)
            for joint, column in zip(self.joints, values.T, strict=True)
        }

    def whole_errors(self, model: tuple[str, str]) -> dict[str, Drawn]:
        """Errors over all joints on the test part.

        `limit_percent`: rms over twice the joint's limit, mean over joints (NRMS); `relative_percent`: rms
        over that of the torques; `norm_n_m`: mean norm.
        """
        key, joints = "/".join(model), len(self.joints)
        blocks = matching(self["blocks"], part=self.tested).sort_values(["block", "joint"], kind="stable")
        sums = blocks[["samples", "torque_squared", key]].to_numpy().reshape(-1, joints, 3)
        norms = matching(self["norms"], part=self.tested)[["samples", key]].to_numpy()
        counts = drawn_counts(len(sums), self.parameters.draws, SEED)
        counts = np.vstack([np.ones(len(sums)), counts])  # the first row is the whole part
        samples, squared, errors = np.moveaxis(np.tensordot(counts, sums, 1), -1, 0)
        limits = 2.0 * self["gravity"]["limit_n_m"].replace(0.0, np.nan).to_numpy()  # 0: the URDF has none
        lengths = counts @ norms
        by_joint = {
            "limit_percent": 100.0 * (np.sqrt(errors / samples) / limits).mean(axis=1),
            "relative_percent": 100.0 * np.sqrt(errors.sum(axis=1) / squared.sum(axis=1)),
            "norm_n_m": lengths[:, 1] / lengths[:, 0],
        }
        return {name: Drawn(values, len(sums)) for name, values in by_joint.items()}

    def load_kg(self, pair: str, gains: str) -> Drawn:
        """Mass of the load in kg."""
        return self._drawn("load", "mass_kg", pair=pair, gains=gains)

    def load_error(self, pair: str, gains: str) -> Drawn:
        """Error of the load's mass in %."""
        assert self.parameters.load is not None
        return self.load_kg(pair, gains).over(self.parameters.load.known_kg)

    def carried(self, log: str) -> tuple[pd.Series, Drawn]:
        """Masses in kg estimated while the load was carried and settled, and their mean absolute error in %.

        The error has no draws if this time is too short.
        """
        own, load = self.parameters, self.parameters.load
        assert load is not None
        carried = matching(self["carried"], log=log, stage=protocol.CARRYING)
        masses = carried.loc[carried["since_s"] > load.settled_s, "mass_kg"]
        error = 100.0 * np.abs(masses.to_numpy() / load.known_kg - 1.0)
        length = round(load.memory_s * own.rate_hz / load.batch)
        count = block_count(len(error), length)
        if count < FEWEST_BLOCKS:
            return masses, Drawn(np.array([error.mean() if len(error) else np.nan, np.nan]), count)
        sums = block_sums(np.stack([error, np.ones_like(error)], axis=1), length)
        errors, samples = (drawn_counts(count, own.draws, SEED) @ sums).T
        return masses, Drawn(np.append(error.mean(), errors / samples), count)

    def drive(self, quantity: str, joint: int, log: str = "") -> Drawn:
        """A gain in N m/A, or a delay in ms, of one joint; by default from the training log."""
        drawn = self._drawn("drive", "value", quantity=quantity, joint=joint, log=log or self.train_log)
        return Drawn(1e3 * drawn.samples, drawn.n) if quantity == protocol.DELAY else drawn

    def rest_log(self) -> str | None:
        """The log of the arm at rest that gave the drives' gains, if any."""
        return next(iter(matching(self["drives"], quantity=protocol.AT_REST)["log"]), None)

    def _drawn(self, table: str, column: str, **keys: object) -> Drawn:
        """One row of a table with its draws."""
        whole, draws = matching(self[f"{table}s"], **keys).iloc[0], matching(self[f"{table}_draws"], **keys)
        return Drawn(np.append(whole[column], draws[column]), whole["blocks"])


def motion_findings(results: MotionResults) -> Findings:
    """Findings of the page; what the logs cannot decide is unknown."""
    find = Findings("blocks of motion")
    rows = _models(results) | _drives(results) | _load(results) | results.whole_errors(results.best)
    for name, row in rows.items():
        evidence = _evidence(row) or unknown(MISSING.get(name, ""))
        find.add(name, evidence, unit=UNITS.get(name, ""), headline=name in HEADLINES)
    apart = matching(results["repeats"], part=results.tested)["difference"]
    find.among("test motions").exact(
        "test_motion_difference", apart.min(), len(apart), unit="of its spread", headline=True
    )
    written = results["written"]["difference_n_m"]
    find.among("joints").exact("written_torques", float(written.max()), len(written), unit="N m")
    over, removed = differing_losses(results)
    among = find.among("joints")
    among.geometric_mean("over_repeatability", over, missing="nothing repeats a motion that differs")
    among.mean("refitted", removed or None, missing="no test motion differs from the training motion")
    links = matching(results["links"], model=BEST, friction=results.best[1])
    possible = links[["positive_mass", "positive_definite", "triangle"]].all(axis=1)
    find.among("links").exact_count("possible_bodies", int(possible.sum()), len(possible))
    return find


def differing_losses(results: MotionResults) -> tuple[pd.Series, dict[str, pd.Series]]:
    """Losses on motion that differs, by joint.

    Returns the model's rms error over the log's repeatability, and the share of its squared error that a fit
    of each group of terms to the test motion removes. Empty if there are none.
    """
    losses, over = results.losses, pd.Series(dtype=float)
    if REPEATABILITY in losses:
        over = losses[LEARNED] / losses[REPEATABILITY]
    fitted = (*REFITTED, ALL) if len(losses) else ()
    return over, {name: 1.0 - (losses[name] / losses[LEARNED]) ** 2 for name in fitted}


def _evidence(row: Row) -> Found:
    """Evidence of a row; intervals of several cases hold jointly."""
    if isinstance(row, Mapping):
        return {
            case: value.evidence(len(row)) if isinstance(value, Drawn) else value
            for case, value in row.items()
        }
    return row.evidence() if isinstance(row, Drawn) else row


def _models(results: MotionResults) -> dict[str, Row]:
    test, part = results.test, results.tested
    structures = [key for name in ("symm", *STRICT) if (key := (name, "viscous")) in test.index]
    better = test.loc[structures].max() < test.loc[URDF]
    levels = {key: results.mean_nmse(key) for key in test.index}
    worst = levels[max(structures, key=lambda key: levels[key].value)]
    by_seed = matching(results["errors"], part=part).groupby(["model", "friction", "seed"])["nmse"].mean()
    own, bounds = (results.joint_nmse(part, key) for key in (results.best, results.bounds))
    strict = [kind for kind in STRICT if (kind, "viscous") in levels]
    consistent = [kind for kind in ("tri", "cov") if (kind, "coulomb") in levels]
    with_coulomb, last = test.loc[[(kind, "coulomb") for kind in consistent]], test.columns[-1]
    count, above = len(consistent), {}
    for terms, words in FRICTIONS.items():
        if (BOUNDS, terms) in levels:
            ratios = [test.loc[kind, terms] / test.loc[BOUNDS, terms] for kind in consistent]
            above[words] = exact(max(ratio.max() for ratio in ratios), count * len(better))
    return {
        "nmse": levels[results.best],
        "nmse_urdf": levels[URDF],
        "mean_nmse": {model_words(key): drawn.evidence() for key, drawn in levels.items()},
        "better_joints": exact_count(int(better.sum()), len(better)),
        "over_networks": {
            MODELS[key[0]]: Drawn(levels[key].samples - worst.samples, worst.n)
            for key in levels
            if key in RIVALS
        },
        "over_networks_by_seed": {
            MODELS[key[0]]: mean(by_seed[key] - worst.value) for key in RIVALS[::2] if key in levels
        },
        "coulomb_factor": {
            MODELS[kind]: Drawn(levels[kind, "viscous"].samples / levels[kind, "coulomb"].samples, worst.n)
            for kind in strict
        },
        "errors": {
            f"{log}: {joint}" if len(results.parts) > 2 else joint: errors
            for log in results.parts[1:]
            for joint, errors in results.joint_nmse(log, results.best).items()
            if log == part or errors.n >= FEWEST_BLOCKS
        },
        "level": {key: Drawn(drawn.samples / bounds[key].samples, drawn.n) for key, drawn in own.items()},
        "over_least_squares": above,
        "coulomb_errors": {
            f"joints 1 to {last - 1}": exact(with_coulomb.drop(columns=last).mean(axis=1).max(), count),
            f"joint {last}": exact(with_coulomb[last].max(), count),
        },
    }


def _drives(results: MotionResults) -> dict[str, Row]:
    if "drives" not in results:
        return dict.fromkeys(("delays", "assumed_gains"), unknown("the log holds torques, no currents"))
    gains = results["gains"].query("assumed").set_index("joint")["found"]
    return {
        "delays": {f"joint {joint}": results.drive(protocol.DELAY, joint) for joint in results.joints},
        "assumed_gains": {
            f"joint {joint}": results.drive(protocol.IN_MOTION, joint).over(gain)
            for joint, gain in gains.items()
        },
    }


def _load(results: MotionResults) -> dict[str, Row]:
    carried = {log: results.carried(log)[1] for log in results.carried_logs}
    missing = unknown("no motion is recorded with and without a load")
    rows: dict[str, Row] = dict.fromkeys(("load_kg", "load_alone", "load_quoted"), missing)
    if carried:
        rows["load_kg"] = results.load_kg(protocol.ALL_PAIRS, protocol.FOUND)
        rows["load_alone"] = {log: results.load_error(log, protocol.FOUND) for log in carried}
        if protocol.QUOTED in set(results["loads"]["gains"]):
            rows["load_quoted"] = results.load_error(protocol.ALL_PAIRS, protocol.QUOTED)
    return rows | {"load_carried": {log: drawn for log, drawn in carried.items() if drawn.n >= FEWEST_BLOCKS}}
