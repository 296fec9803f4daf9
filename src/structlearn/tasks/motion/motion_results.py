"""What the logs of an arm tell: errors by joint and model, drives and a load, each with its interval."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from structlearn.core.metrics import block_count, block_sums, drawn_counts, percentiles
from structlearn.palette import BLACK, BLUE, GREEN, GREY, LIGHT_BLUE, OCHRE, ORANGE, PINK, Look
from structlearn.reporting.claims import Evidence, Found, confidence, counted, exact, mean, unknown
from structlearn.reporting.findings import Findings
from structlearn.rigid_body.model_names import DEFAULT, NAMES, STRICT
from structlearn.rigid_body.motion import drawn_nmse
from structlearn.tasks.motion.motion_parameters import (
    ALL_PAIRS,
    AT_REST,
    CARRYING,
    DELAY,
    FOUND,
    IN_MOTION,
    QUOTED,
    MotionParameters,
)

# The URDF as it came; the kinds that become a URDF, and that need not be physically consistent.
URDF, BEST, BOUNDS = ("urdf", "none"), "cov", "least_squares"

RIVALS = (("mlp", "none"), ("mlp_scaled", "none"), ("delan", "viscous"))

MODELS = {"urdf": NAMES[DEFAULT]} | NAMES | {BOUNDS: "least squares"}
FRICTIONS = {
    "none": "",
    "viscous": "viscous",
    "coulomb": "viscous, Coulomb",
    "offset": "viscous, Coulomb, offset",
    "stiffness": "viscous, Coulomb, offset, stiffness",
}
# Models with their friction as figures show them; keys are those of the protocol's tables.
LOOKS = {
    URDF: Look(MODELS["urdf"], GREY),
    ("mlp", "none"): Look("MLP", ORANGE),
    ("mlp_scaled", "none"): Look("MLP, scaled", OCHRE),
    ("delan", "viscous"): Look("DeLaN", PINK),
    (BEST, "viscous"): Look("Cov, viscous", LIGHT_BLUE),
    (BEST, "coulomb"): Look("Cov, Coulomb", BLUE),
    (BEST, "offset"): Look("Cov, Coulomb, offset", GREEN),
    (BEST, "stiffness"): Look("Cov, Coulomb, offset, stiffness", OCHRE),
    (BOUNDS, "coulomb"): Look("least squares, Coulomb", BLACK),
    (BOUNDS, "offset"): Look("least squares, Coulomb, offset", BLACK),
    (BOUNDS, "stiffness"): Look("least squares, Coulomb, offset, stiffness", BLACK),
}

FEWEST_BLOCKS = 3  # an interval over fewer blocks is not reliable
NO_LOAD = "no motion is recorded with and without a load"
HEADLINES = ("nmse", "nmse_urdf", "limit_percent", "relative_percent", "norm_n_m", "load_kg", "load_carried")
# Of findings by name; others have none.
UNITS = {"delays": "ms", "assumed_gains": "%", "load_kg": "kg", "norm_n_m": "N m"} | dict.fromkeys(
    ("load", "load_alone", "load_quoted", "load_carried", "limit_percent", "relative_percent"), "%"
)


@dataclass(frozen=True)
class Drawn:
    """A number with (D,) draws of the bootstrap, and the number of blocks that were drawn from."""

    value: float
    draws: np.ndarray
    n: int

    def evidence(self, comparisons: int = 1) -> Evidence:
        """The number with its interval."""
        low, high = percentiles(self.draws, confidence(comparisons))
        return Evidence(float(self.value), float(low), float(high), self.n)

    def scaled(self, factor: float, shift: float = 0.0) -> "Drawn":
        """The same in another unit."""
        return Drawn(factor * self.value + shift, factor * self.draws + shift, self.n)

    def __sub__(self, other: "Drawn") -> "Drawn":
        return Drawn(self.value - other.value, self.draws - other.draws, self.n)

    def __truediv__(self, other: "Drawn") -> "Drawn":
        return Drawn(self.value / other.value, self.draws / other.draws, self.n)


def chosen(table: pd.DataFrame, **keys: object) -> pd.DataFrame:
    """Rows whose columns have these values."""
    return table[np.logical_and.reduce([table[name] == value for name, value in keys.items()])]


def model_words(key: tuple[str, str]) -> str:
    """`Cov, viscous, Coulomb`."""
    return ", ".join(filter(None, (MODELS[key[0]], FRICTIONS[key[1]])))


class MotionResults(dict[str, pd.DataFrame]):
    """Tables of `joint_motion.learn_motion` by name.

    Attributes:
        parameters: that they were made with.
        best, bounds: the model that verdicts are about, and least squares with the same friction.
        parts, tested: `train`, the part that verdicts are about, and further ones; the second of them.
        names, joints: of the joints, and their numbers from 1.
        train_log: the first log that was learned from.
        carried_logs: logs with the load.
        errors, test: by part, NMSE by model, friction and joint, mean over seeds; that of the tested part.
    """

    def __init__(self, tables: Mapping[str, pd.DataFrame], parameters: MotionParameters) -> None:
        super().__init__(tables)
        self.parameters, friction = parameters, parameters.judged_friction
        self.best, self.bounds = (BEST, friction), (BOUNDS, friction)
        self.parts: list[str] = self["blocks"]["part"].unique().tolist()
        self.tested = self.parts[1]
        self.names, self.joints = (self["gravity"][column].tolist() for column in ("name", "joint"))
        self.train_log = str(self["motions"].query("learned_s > 0")["log"].iloc[0])
        self.carried_logs: list[str] = self["carried"]["log"].unique().tolist() if "carried" in self else []
        keys, models, frictions = ["part", "model", "friction"], list(MODELS), list(FRICTIONS)
        wide = self["errors"].pivot_table(index=keys, columns="joint", values="nmse", sort=False)
        order = sorted(wide.index, key=lambda key: (frictions.index(key[2]), models.index(key[1])))
        self.errors = {
            part: wide.loc[[key for key in order if key[0] == part]].loc[part] for part in self.parts
        }
        self.test = self.errors[self.tested]

    def nmse(self, part: str, model: tuple[str, str]) -> tuple[np.ndarray, np.ndarray, int]:
        """NMSE (n,) of a model on a part, the same of drawn blocks (D, n), and the number of blocks."""
        blocks = chosen(self["blocks"], part=part)
        return drawn_nmse(blocks, model, self.parameters.draws, self.parameters.seed)

    def mean_nmse(self, model: tuple[str, str]) -> Drawn:
        """Mean over the joints on the part that is tested on."""
        value, draws, count = self.nmse(self.tested, model)
        return Drawn(value.mean(), draws.mean(axis=1), count)

    def joint_nmse(self, part: str, model: tuple[str, str]) -> dict[str, Drawn]:
        """NMSE of a model by joint (`joint 1`, ...)."""
        values, draws, count = self.nmse(part, model)
        each = zip(self.joints, values, draws.T, strict=True)
        return {f"joint {joint}": Drawn(value, its, count) for joint, value, its in each}

    def whole_errors(self, model: tuple[str, str]) -> dict[str, Drawn]:
        """Errors of all joints together on the part that is tested on.

        `limit_percent`: mean over the joints of the root mean square, over twice the joint's limit (NRMS);
        `relative_percent`: root mean square over that of the torques; `norm_n_m`: mean norm.
        """
        key, joints = "/".join(model), len(self.joints)
        its = chosen(self["blocks"], part=self.tested).sort_values(["block", "joint"])
        sums = its[["samples", "torque_squared", key]].to_numpy().reshape(-1, joints, 3)
        norms = chosen(self["norms"], part=self.tested)[["samples", key]].to_numpy()
        counts = drawn_counts(len(sums), self.parameters.draws, self.parameters.seed)
        counts = np.vstack([np.ones(len(sums)), counts])  # the first is the whole
        samples, squared, errors = np.moveaxis(np.tensordot(counts, sums, 1), -1, 0)
        limits = 2.0 * self["gravity"]["limit_n_m"].replace(0.0, np.nan).to_numpy()  # 0: the URDF has none
        lengths = counts @ norms
        drawn = {
            "limit_percent": 100.0 * (np.sqrt(errors / samples) / limits).mean(axis=1),
            "relative_percent": 100.0 * np.sqrt(errors.sum(axis=1) / squared.sum(axis=1)),
            "norm_n_m": lengths[:, 1] / lengths[:, 0],
        }
        return {name: Drawn(values[0], values[1:], len(sums)) for name, values in drawn.items()}

    def load_kg(self, pair: str, gains: str) -> Drawn:
        """Mass of the load in kg."""
        whole = chosen(self["loads"], pair=pair, gains=gains).iloc[0]
        draws = chosen(self["load_draws"], pair=pair, gains=gains)["mass_kg"].to_numpy()
        return Drawn(whole["mass_kg"], draws, whole["blocks"])

    def load_error(self, pair: str, gains: str) -> Drawn:
        """Error of the load's mass in percent."""
        assert self.parameters.load is not None
        return self.load_kg(pair, gains).scaled(100.0 / self.parameters.load.known_kg, -100.0)

    def carried(self, log: str) -> tuple[pd.Series, Drawn]:
        """Masses in kg found while the load was carried, after the wait, and their mean absolute error in %.

        The error has no draws where that is too short.
        """
        own, load = self.parameters, self.parameters.load
        assert load is not None
        its = chosen(self["carried"], log=log, stage=CARRYING)
        masses = its.loc[its["since_s"] > load.settled_s, "mass_kg"]
        error = 100.0 * np.abs(masses.to_numpy() / load.known_kg - 1.0)
        length = round(load.memory_s * own.rate_hz / load.batch)
        count = block_count(len(error), length)
        if count < FEWEST_BLOCKS:
            return masses, Drawn(error.mean() if len(error) else np.nan, np.array([np.nan]), count)
        sums = block_sums(np.stack([error, np.ones_like(error)], axis=1), length)
        drawn = drawn_counts(count, own.draws, own.seed) @ sums
        return masses, Drawn(error.mean(), drawn[:, 0] / drawn[:, 1], count)

    def drive(self, quantity: str, joint: int, log: str = "") -> Drawn:
        """A gain in N m/A, or a delay in ms, of one joint; by default in the log that was learned from."""
        keys = {"quantity": quantity, "joint": joint, "log": log or self.train_log}
        whole = chosen(self["drives"], **keys).iloc[0]
        draws = chosen(self["drive_draws"], **keys)["value"].to_numpy()
        return Drawn(whole["value"], draws, whole["blocks"]).scaled(1e3 if quantity == DELAY else 1.0)

    def rest_log(self) -> str | None:
        """The log of the arm at rest that gave the drives' gains."""
        return next(iter(chosen(self["drives"], quantity=AT_REST)["log"]), None)


def motion_findings(results: MotionResults) -> Findings:
    """Every number of the page that is no table's; what the logs cannot decide is unknown."""
    find = Findings("blocks of motion")
    rows = _models(results) | _drives(results) | _load(results)
    rows |= {name: its.evidence() for name, its in results.whole_errors(results.best).items()}
    for name, found in rows.items():
        find.add(name, found, unit=UNITS.get(name, ""), headline=name in HEADLINES)
    written = results["written"]["difference_n_m"]
    find.among("joints").exact("written_torques", float(written.max()), len(written), unit="N m")
    links = chosen(results["links"], model=BEST, friction=results.parameters.judged_friction)
    possible = links[["positive_mass", "positive_definite", "triangle"]].all(axis=1)
    find.among("links").counted("possible_bodies", int(possible.sum()), len(possible))
    return find


def _cases(drawn: Mapping[str, Drawn], missing: str = "") -> Found:
    """Intervals that hold together, or why there are none."""
    return {name: one.evidence(len(drawn)) for name, one in drawn.items()} or unknown(missing)


def _models(results: MotionResults) -> dict[str, Found]:
    test, part = results.test, results.tested
    structures = [key for name in ("symm", *STRICT) if (key := (name, "viscous")) in test.index]
    better = test.loc[structures].max() < test.loc[URDF]
    levels = {key: results.mean_nmse(key) for key in test.index}
    worst = levels[max(structures, key=lambda key: levels[key].value)]
    by_seed = chosen(results["errors"], part=part).groupby(["model", "friction", "seed"])["nmse"].mean()
    own, bounds = (results.joint_nmse(part, key) for key in (results.best, results.bounds))
    further = {
        f"{log}: {joint}": found
        for log in results.parts[2:]
        for joint, found in results.joint_nmse(log, results.best).items()
        if found.n >= FEWEST_BLOCKS
    }
    consistent = [kind for kind in ("tri", "cov") if (kind, "coulomb") in test.index]
    with_coulomb, last = test.loc[[(kind, "coulomb") for kind in consistent]], test.columns[-1]
    first, count = with_coulomb.drop(columns=last).mean(axis=1), len(consistent)
    return {
        "nmse": levels[results.best].evidence(),
        "nmse_urdf": levels[URDF].evidence(),
        "mean_nmse": {model_words(key): its.evidence() for key, its in levels.items()},
        "better_joints": counted(int(better.sum()), len(better)),
        "over_networks": _cases(
            {MODELS[key[0]]: levels[key] - worst for key in levels if key in RIVALS},
            "no networks were trained",
        ),
        "over_networks_by_seed": {
            MODELS[key[0]]: mean(by_seed[key] - worst.value) for key in RIVALS[::2] if key in levels
        }
        or unknown("no networks were trained"),
        "coulomb_factor": _cases(
            {
                MODELS[kind]: levels[kind, "viscous"] / levels[kind, "coulomb"]
                for kind in STRICT
                if (kind, "viscous") in levels
            }
        ),
        "errors": _cases(own),
        "further_errors": _cases(further, "no further motion is long enough"),
        "level": _cases({joint: its / bounds[joint] for joint, its in own.items()}),
        "over_least_squares": {
            words: exact(
                max((test.loc[kind, key] / test.loc[BOUNDS, key]).max() for kind in consistent),
                count * len(better),
            )
            for key, words in FRICTIONS.items()
            if (BOUNDS, key) in test.index
        },
        "coulomb_errors": {
            f"joints 1 to {last - 1}": exact(first.max(), count),
            f"joint {last}": exact(with_coulomb[last].max(), count),
        },
    }


def _drives(results: MotionResults) -> dict[str, Found]:
    if "drives" not in results:
        return dict.fromkeys(("delays", "assumed_gains"), unknown("the log holds torques, no currents"))
    gains = results["gains"].query("assumed").set_index("joint")["found"]
    assumed = {
        f"joint {joint}": results.drive(IN_MOTION, joint).scaled(100.0 / found, -100.0)
        for joint, found in gains.items()
    }
    return {
        "delays": _cases({f"joint {joint}": results.drive(DELAY, joint) for joint in results.joints}),
        "assumed_gains": _cases(assumed, "every gain is found at rest, or none is"),
    }


def _load(results: MotionResults) -> dict[str, Found]:
    found: dict[str, Found] = dict.fromkeys(
        ("load_kg", "load", "load_alone", "load_quoted"), unknown(NO_LOAD)
    )
    carried = {log: results.carried(log)[1] for log in results.carried_logs}
    if carried:
        found["load_kg"] = results.load_kg(ALL_PAIRS, FOUND).evidence()
        found["load"] = results.load_error(ALL_PAIRS, FOUND).evidence()
        found["load_alone"] = _cases({log: results.load_error(log, FOUND) for log in carried})
        if QUOTED in set(results["loads"]["gains"]):
            found["load_quoted"] = results.load_error(ALL_PAIRS, QUOTED).evidence()
    long = {log: its for log, its in carried.items() if its.n >= FEWEST_BLOCKS}
    return found | {"load_carried": _cases(long, "nowhere is the load carried long enough")}
