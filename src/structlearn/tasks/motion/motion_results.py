"""What the logs of an arm tell: errors by joint and model, drives and a load, each with its interval."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from structlearn.core.metrics import block_count, block_sums, drawn_counts, percentiles
from structlearn.palette import BLACK, BLUE, GREEN, GREY, LIGHT_BLUE, OCHRE, ORANGE, PINK, Look
from structlearn.reporting.claims import Evidence, Found, confidence, counted, exact, mean, unknown
from structlearn.reporting.findings import Findings
from structlearn.rigid_body.model_names import DEFAULT, NAMES, STRICT
from structlearn.rigid_body.motion import drawn_nmse
from structlearn.tasks.motion.motion_parameters import DriveParameters, LoadParameters, MotionParameters

URDF, BEST, BOUNDS = ("urdf", "none"), "cov", "least_squares"
"""The URDF as it came; the kinds that become a URDF, and that need not be physically consistent."""

RIVALS = (("mlp", "none"), ("mlp_scaled", "none"), ("delan", "viscous"))
CONSISTENT = ("tri", "cov")
TEXT_STRUCTURES = ("symm", *STRICT)
"""Structures that table III.2 has."""

MODELS = {"urdf": NAMES[DEFAULT]} | NAMES | {"least_squares": "least squares"}
FRICTIONS = {
    "none": "",
    "viscous": "viscous",
    "coulomb": "viscous, Coulomb",
    "offset": "viscous, Coulomb, offset",
}
LOOKS = {
    URDF: Look(MODELS["urdf"], GREY),
    ("mlp", "none"): Look("MLP", ORANGE),
    ("mlp_scaled", "none"): Look("MLP, scaled", OCHRE),
    ("delan", "viscous"): Look("DeLaN", PINK),
    ("cov", "viscous"): Look("Cov, viscous", LIGHT_BLUE),
    (BEST, "coulomb"): Look("Cov, Coulomb", BLUE),
    ("cov", "offset"): Look("Cov, Coulomb, offset", GREEN),
    (BOUNDS, "coulomb"): Look("least squares, Coulomb", BLACK),
    (BOUNDS, "offset"): Look("least squares, Coulomb, offset", BLACK),
}
"""Models with their friction as figures show them; keys are those of the protocol's tables."""

LEARNED, EMPTY, CARRYING = "empty, learned from", "empty, another motion", "with the load"
ALL_PAIRS = "all pairs"
"""Keys of the load's tables."""

FEWEST_BLOCKS = 3
"""An interval over fewer blocks is not reliable."""

NO_LOAD = unknown("no motion is recorded with and without a load")
NO_NETWORKS = unknown("no networks were trained")


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


def chosen(table: pd.DataFrame, **keys: object) -> pd.DataFrame:
    """Rows whose columns have these values."""
    return table[np.logical_and.reduce([table[name] == value for name, value in keys.items()])]


def model_words(key: tuple[str, str]) -> str:
    """`Cov, viscous, Coulomb`."""
    return ", ".join(filter(None, (MODELS[key[0]], FRICTIONS[key[1]])))


@dataclass(frozen=True)
class MotionResults:
    """Tables of `joint_motion.learn_motion` by name, and the parameters that they were made with."""

    tables: Mapping[str, pd.DataFrame]
    parameters: MotionParameters

    def __getitem__(self, name: str) -> pd.DataFrame:
        return self.tables[name]

    @property
    def best(self) -> tuple[str, str]:
        """The model that verdicts are about."""
        return BEST, self.parameters.judged_friction

    @property
    def bounds(self) -> tuple[str, str]:
        """Least squares with the same friction."""
        return BOUNDS, self.parameters.judged_friction

    @cached_property
    def parts(self) -> list[str]:
        """`train`, the part that is tested on, and further ones."""
        return list(self["blocks"]["part"].unique())

    @property
    def tested(self) -> str:
        """The part that verdicts are about."""
        return self.parts[1]

    @property
    def train_log(self) -> str:
        """The first log that was learned from."""
        return str(self["motions"].query("learned_s > 0")["log"].iloc[0])

    @property
    def rest_log(self) -> str | None:
        """The log of the arm at rest that gave the drives' gains."""
        return next(iter(chosen(self["drives"], quantity="gain at rest")["log"]), None)

    @property
    def names(self) -> list[str]:
        """Of the joints."""
        return self["gravity"]["name"].tolist()

    @cached_property
    def joints(self) -> list[int]:
        """Numbers of the joints, from 1."""
        return self["gravity"]["joint"].tolist()

    @property
    def of_drives(self) -> DriveParameters:
        """Parameters of the drives."""
        assert self.parameters.drives is not None
        return self.parameters.drives

    @property
    def of_load(self) -> LoadParameters:
        """Parameters of the load."""
        assert self.parameters.load is not None
        return self.parameters.load

    @cached_property
    def errors(self) -> dict[str, pd.DataFrame]:
        """By part: NMSE by model and friction, in their order, and joint; mean over seeds."""
        wide = self["errors"].pivot_table(
            index=["part", "model", "friction"], columns="joint", values="nmse", sort=False
        )
        models, frictions = list(MODELS), list(FRICTIONS)
        order = sorted(wide.index, key=lambda key: (frictions.index(key[2]), models.index(key[1])))
        return {part: wide.loc[[key for key in order if key[0] == part]].loc[part] for part in self.parts}

    @property
    def test(self) -> pd.DataFrame:
        """Errors on the part that is tested on."""
        return self.errors[self.tested]

    def nmse(self, part: str, model: tuple[str, str]) -> tuple[np.ndarray, np.ndarray, int]:
        """NMSE (n,) of a model on a part, the same of drawn blocks (D, n), and the number of blocks."""
        blocks = chosen(self["blocks"], part=part)
        return drawn_nmse(blocks, model, self.parameters.draws, self.parameters.seed)

    def mean_nmse(self, model: tuple[str, str]) -> Drawn:
        """Mean over the joints on the part that is tested on."""
        value, draws, count = self.nmse(self.tested, model)
        return Drawn(value.mean(), draws.mean(axis=1), count)

    def joint_nmse(self, part: str, model: tuple[str, str] | None = None) -> dict[str, Drawn]:
        """NMSE of a model, by default the best, by joint (`joint 1`, ...)."""
        values, draws, count = self.nmse(part, model or self.best)
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
        lengths, drawn = counts @ norms, {}
        limits = 2.0 * self["gravity"]["limit_n_m"].replace(0.0, np.nan).to_numpy()  # 0: the URDF has none
        drawn["limit_percent"] = 100.0 * (np.sqrt(errors / samples) / limits).mean(axis=1)
        drawn["relative_percent"] = 100.0 * np.sqrt(errors.sum(axis=1) / squared.sum(axis=1))
        drawn["norm_n_m"] = lengths[:, 1] / lengths[:, 0]
        return {name: Drawn(values[0], values[1:], len(sums)) for name, values in drawn.items()}

    @property
    def carried_logs(self) -> list[str]:
        """Logs with the load, in order."""
        return list(dict.fromkeys(self["carried"]["log"])) if "carried" in self.tables else []

    def load_error(self, pair: str, gains: str) -> Drawn:
        """Error of the load's mass in percent."""
        whole = chosen(self["loads"], pair=pair, gains=gains).iloc[0]
        draws = chosen(self["load_draws"], pair=pair, gains=gains)["mass_kg"].to_numpy()
        found = Drawn(whole["mass_kg"], draws, whole["blocks"])
        return found.scaled(100.0 / self.of_load.known_kg, -100.0)

    def load_kg(self, pair: str, gains: str) -> Drawn:
        """Mass of the load in kg."""
        true = self.of_load.known_kg
        return self.load_error(pair, gains).scaled(0.01 * true, true)

    def settled(self, log: str) -> pd.DataFrame:
        """What was found while the load was carried, after the wait."""
        its = chosen(self["carried"], log=log, stage=CARRYING)
        return its[its["since_s"] > self.of_load.settled_s]

    def carried_error(self, log: str) -> Drawn:
        """Mean absolute error of the mass in percent while it is carried; no draws where that is short."""
        load, own = self.of_load, self.parameters
        error = 100.0 * np.abs(self.settled(log)["mass_kg"].to_numpy() / load.known_kg - 1.0)
        length = round(load.memory_s * own.rate_hz / load.batch)
        count = block_count(len(error), length)
        if count < FEWEST_BLOCKS:
            return Drawn(error.mean() if len(error) else np.nan, np.array([np.nan]), count)
        sums = block_sums(np.stack([error, np.ones_like(error)], axis=1), length)
        drawn = drawn_counts(count, own.draws, own.seed) @ sums
        return Drawn(error.mean(), drawn[:, 0] / drawn[:, 1], count)

    def drive(self, quantity: str, log: str, joint: int) -> Drawn:
        """A gain in N m/A, or a delay in s, of one joint."""
        whole = chosen(self["drives"], quantity=quantity, log=log, joint=joint).iloc[0]
        draws = chosen(self["drive_draws"], quantity=quantity, log=log, joint=joint)["value"].to_numpy()
        return Drawn(whole["value"], draws, whole["blocks"])


def motion_findings(results: MotionResults) -> Findings:
    """Every number of the page that is no table's; what the logs cannot decide is unknown."""
    find = Findings("blocks of motion")
    rows = _models(results) | _drives(results) | _load(results)
    rows |= {name: its.evidence() for name, its in results.whole_errors(results.best).items()}
    for name, found in rows.items():
        find.add(name, found, unit=UNITS.get(name, ""), headline=name in HEADLINES)
    find.among("joints").exact("written_torques", *_worst(results["written"]["difference_n_m"]), unit="N m")
    links = chosen(results["links"], model=BEST, friction=results.parameters.judged_friction)
    possible = links[["positive_mass", "positive_definite", "triangle"]].all(axis=1)
    find.among("links").counted("possible_bodies", int(possible.sum()), len(possible))
    return find


HEADLINES = ("nmse", "nmse_urdf", "limit_percent", "relative_percent", "norm_n_m", "load_kg", "load_carried")
UNITS = {"delays": "ms", "assumed_gains": "%", "load_kg": "kg", "norm_n_m": "N m"} | dict.fromkeys(
    ("load", "load_alone", "load_quoted", "load_carried", "limit_percent", "relative_percent"), "%"
)
"""Of findings by name; others have none."""


def _worst(values: pd.Series) -> tuple[float, int]:
    return float(values.max()), len(values)


def _cases(drawn: Mapping[str, Drawn], missing: str = "") -> Found:
    """Intervals that hold together, or why there are none."""
    return {name: one.evidence(len(drawn)) for name, one in drawn.items()} or unknown(missing)


def _models(results: MotionResults) -> dict[str, Found]:
    test, part = results.test, results.tested
    known = set(test.index)
    structures = [key for name in TEXT_STRUCTURES if (key := (name, "viscous")) in known]
    better = test.loc[structures].max() < test.loc[URDF]
    levels = {key: results.mean_nmse(key) for key in (*structures, *RIVALS) if key in known}
    worst = levels[max(structures, key=lambda key: levels[key].value)]
    apart = {
        MODELS[key[0]]: Drawn(its.value - worst.value, its.draws - worst.draws, its.n)
        for key, its in levels.items()
        if key in RIVALS
    }
    rows = chosen(results["errors"], part=part)
    by_seed = rows.groupby(["model", "friction", "seed"])["nmse"].mean()
    factors = {}
    for kind in (name for name in STRICT if (name, "viscous") in known):
        rough, fine = (results.mean_nmse((kind, friction)) for friction in ("viscous", "coulomb"))
        factors[MODELS[kind]] = Drawn(rough.value / fine.value, rough.draws / fine.draws, rough.n)
    own, bounds = (results.joint_nmse(part, key) for key in (results.best, results.bounds))
    level = {
        joint: Drawn(its.value / bounds[joint].value, its.draws / bounds[joint].draws, its.n)
        for joint, its in own.items()
    }
    further = {
        f"{log}: {joint}": found
        for log in results.parts[2:]
        for joint, found in results.joint_nmse(log).items()
        if found.n >= FEWEST_BLOCKS
    }
    consistent = [kind for kind in CONSISTENT if (kind, "coulomb") in known]
    with_coulomb, last = test.loc[[(kind, "coulomb") for kind in consistent]], test.columns[-1]
    return {
        "nmse": results.mean_nmse(results.best).evidence(),
        "nmse_urdf": results.mean_nmse(URDF).evidence(),
        "mean_nmse": {model_words(key): results.mean_nmse(key).evidence() for key in test.index},
        "better_joints": counted(int(better.sum()), len(better)),
        "over_networks": _cases(apart, NO_NETWORKS.reason),
        "over_networks_by_seed": {
            MODELS[key[0]]: mean(by_seed[key] - worst.value) for key in RIVALS[::2] if key in known
        }
        or NO_NETWORKS,
        "coulomb_factor": _cases(factors),
        "errors": _cases(own),
        "further_errors": _cases(further, "no further motion is long enough"),
        "level": _cases(level),
        "over_least_squares": {
            FRICTIONS[friction]: exact(
                max(
                    (test.loc[kind, friction] / test.loc["least_squares", friction]).max()
                    for kind in consistent
                ),
                len(consistent) * len(better),
            )
            for friction in ("viscous", "coulomb", "offset")
        },
        "coulomb_errors": {
            f"joints 1 to {last - 1}": exact(
                with_coulomb.drop(columns=last).mean(axis=1).max(), len(consistent)
            ),
            f"joint {last}": exact(with_coulomb[last].max(), len(consistent)),
        },
    }


def _drives(results: MotionResults) -> dict[str, Found]:
    if "drives" not in results.tables:
        return dict.fromkeys(("delays", "assumed_gains"), unknown("the log holds torques, no currents"))
    train, gains = results.train_log, results["gains"].set_index("joint")
    delays = {f"joint {joint}": results.drive("delay", train, joint).scaled(1e3) for joint in results.joints}
    assumed = {
        f"joint {joint}": results.drive("gain in motion", train, joint).scaled(
            100.0 / gains.loc[joint, "found"], -100.0
        )
        for joint in gains.index[gains["assumed"]]
    }
    return {
        "delays": _cases(delays),
        "assumed_gains": _cases(assumed, "every gain is found at rest, or none is"),
    }


def _load(results: MotionResults) -> dict[str, Found]:
    pairs = results["loads"][["pair", "gains"]].apply(tuple, axis=1).tolist() if results.carried_logs else []
    alone = {log: results.load_error(log, "found") for log in results.carried_logs if (log, "found") in pairs}
    carried = {log: results.carried_error(log) for log in results.carried_logs}
    long = {log: its for log, its in carried.items() if its.n >= FEWEST_BLOCKS}
    together = {
        gains: results.load_error(ALL_PAIRS, gains).evidence() if (ALL_PAIRS, gains) in pairs else NO_LOAD
        for gains in ("found", "quoted")
    }
    whole = results.load_kg(ALL_PAIRS, "found").evidence() if (ALL_PAIRS, "found") in pairs else NO_LOAD
    return {
        "load_kg": whole,
        "load": together["found"],
        "load_alone": _cases(alone, NO_LOAD.reason),
        "load_quoted": together["quoted"],
        "load_carried": _cases(long, "nowhere is the load carried long enough"),
    }
