"""Contents of the page of the UR10e: numbers with intervals from the stage's tables, metrics, evidence."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from structlearn.core.artefacts import Metrics
from structlearn.core.block_bootstrap import block_count, block_sums, drawn_counts, percentiles
from structlearn.reporting.claims import Evidence, Found, confidence, counted, exact, unknown
from structlearn.rigid_body.model_names import STRICT
from structlearn.rigid_body.motion import drawn_nmse
from structlearn.tasks.motion.motion_parameters import DriveParameters, LoadParameters, MotionParameters
from structlearn.tasks.public import public_names
from structlearn.tasks.public.page.parts.panda_part import TEXT_STRUCTURES, errors_by_joint

BEST, BOUNDS = ("cov", "coulomb"), ("least_squares", "coulomb")
"""The model that is judged, and that which no body bounds."""

FEWEST_BLOCKS = 3
"""An interval over fewer says nothing."""

RIVALS = (("mlp", "none"), ("mlp_scaled", "none"), ("delan", "viscous"))

NO_LOAD = unknown("no motion is recorded with and without a load")


@dataclass(frozen=True)
class Drawn:
    """A number with (D,) draws of the bootstrap, and the number of blocks that were drawn from."""

    value: float
    draws: np.ndarray
    n: int

    def evidence(self, comparisons: int = 1) -> Evidence:
        """The number with its interval, as claims take it."""
        low, high = percentiles(self.draws, confidence(comparisons))
        return Evidence(float(self.value), float(low), float(high), self.n)


@dataclass(frozen=True)
class Ur10eResults:
    """Tables of the stage, by their names in `files.SETS`, and the parameters that they were made with."""

    tables: Mapping[str, pd.DataFrame]
    chosen: MotionParameters

    def __getitem__(self, name: str) -> pd.DataFrame:
        return self.tables[name]

    @cached_property
    def parameters(self) -> MotionParameters:
        """Those chosen, with the logs that were there in place of missing ones."""
        drives, asked = self["drives"], self["errors"]["part"]
        rest = drives.loc[drives["quantity"] == "gain at rest", "log"].tolist()
        own = self.chosen.drives
        assert own is not None
        update = {
            "drives": own.model_copy(update={"rest": rest[0] if rest else None}),
            "train": chosen(drives, quantity="delay")["log"].iloc[0],
            "test": asked[asked != "train"].iloc[0],
        }
        return self.chosen.model_copy(update=update)

    @property
    def train(self) -> str:
        """Log that was learned from."""
        return str(self.parameters.train)

    @property
    def tested(self) -> str:
        """Log that was tested on."""
        return str(self.parameters.test)

    @property
    def of_drives(self) -> DriveParameters:
        """What is chosen for drives."""
        assert self.parameters.drives is not None
        return self.parameters.drives

    @property
    def of_load(self) -> LoadParameters:
        """What is chosen for the load."""
        assert self.parameters.load is not None
        return self.parameters.load

    @property
    def joints(self) -> list[int]:
        """From 1."""
        return self["gains"]["joint"].tolist()

    @property
    def further(self) -> list[str]:
        """Test logs besides the main one."""
        known = ("train", self.tested)
        return [part for part in self["blocks"]["part"].unique() if part not in known]

    @cached_property
    def errors(self) -> dict[str, pd.DataFrame]:
        """`errors_by_joint` by part."""
        return {part: errors_by_joint(self["errors"], part) for part in self["errors"]["part"].unique()}

    @property
    def test(self) -> pd.DataFrame:
        """Errors on the test."""
        return self.errors[self.tested]

    def nmse(self, part: str, model: tuple[str, str]) -> tuple[np.ndarray, np.ndarray, int]:
        """NMSE (n,) of a model on a part, the same of drawn blocks (D, n), and the number of blocks."""
        own = self.parameters
        return drawn_nmse(chosen(self["blocks"], part=part), model, own.draws, own.seed)

    def joint_error(self, part: str) -> list[Drawn]:
        """NMSE of the model that is judged, by joint."""
        values, draws, count = self.nmse(part, BEST)
        return [Drawn(value, its, count) for value, its in zip(values, draws.T, strict=True)]

    def load(self, pair: str, gains: str) -> Drawn:
        """Error of the load in percent."""
        true, keys = self.of_load.known_kg, {"pair": pair, "gains": gains}
        whole = chosen(self["loads"], **keys).iloc[0]
        draws = chosen(self["load_draws"], **keys)["mass_kg"].to_numpy()
        return Drawn(100.0 * (whole["mass_kg"] / true - 1.0), 100.0 * (draws / true - 1.0), whole["blocks"])

    def load_kg(self, error: Evidence) -> tuple[float, float, float]:
        """Low end, value and high end in kg of an error in percent."""
        low, value, high = (1.0 + 0.01 * end for end in (error.low, error.value, error.high))
        true = self.of_load.known_kg
        return true * low, true * value, true * high

    @property
    def load_logs(self) -> list[str]:
        """Logs with the load, in order."""
        return list(dict.fromkeys(self["carried"]["log"]))

    def settled(self, log: str) -> pd.DataFrame:
        """What was found while the load was carried, after the wait."""
        its = chosen(self["carried"], log=log, stage="with the load")
        return its[its["since_s"] > self.of_load.settled_s]

    def carried_error(self, log: str) -> Drawn:
        """Mean absolute error of the load in percent, while it is carried; no draws where that is short."""
        load, own = self.of_load, self.parameters
        error = 100.0 * np.abs(self.settled(log)["mass_kg"].to_numpy() / load.known_kg - 1.0)
        length = round(load.memory_s * own.rate_hz / load.batch)
        count = block_count(len(error), length)
        if count < FEWEST_BLOCKS:
            return Drawn(error.mean() if len(error) else np.nan, np.array([np.nan]), count)
        sums = block_sums(np.stack([error, np.ones_like(error)], axis=1), length)
        drawn = drawn_counts(count, own.draws, own.seed) @ sums
        return Drawn(error.mean(), drawn[:, 0] / drawn[:, 1], count)

    def drive(self, quantity: str, log: str, joint: int, scale: float = 1.0) -> Drawn:
        """A gain or delay of one joint, times a factor."""
        keys = {"quantity": quantity, "log": log, "joint": joint}
        whole = chosen(self["drives"], **keys).iloc[0]
        draws = chosen(self["drive_draws"], **keys)["value"].to_numpy()
        return Drawn(scale * whole["value"], scale * draws, whole["blocks"])


def chosen(table: pd.DataFrame, **keys: object) -> pd.DataFrame:
    """Rows whose columns have these values."""
    return table[np.logical_and.reduce([table[name] == value for name, value in keys.items()])]


def ur10e_metrics(results: Ur10eResults) -> Metrics:
    """The flat metrics of the arm."""
    test = results.test
    values: Metrics = {}
    for joint, found in zip(results.joints, results.joint_error(results.tested), strict=True):
        its = found.evidence()
        values[f"ur10e_nmse_{joint}"] = its.value
        values |= {f"ur10e_nmse_{joint}_low": its.low, f"ur10e_nmse_{joint}_high": its.high}
        values[f"ur10e_nmse_{joint}_least_squares"] = test.loc[BOUNDS, joint]
    for model, friction in test.index:
        suffix = "" if friction == "none" else f"_{friction}"
        values[f"ur10e_nmse_mean_{model}{suffix}"] = test.loc[model, friction].mean()
    for log in results.further:
        its = results.errors[log].loc[BEST]
        values |= {f"ur10e_nmse_{joint}_{log.replace('-', '_')}": its[joint] for joint in results.joints}
    for row in results["gains"].itertuples():
        values[f"ur10e_gain_{row.joint}"] = row.found
    for joint in results.joints:
        delay = results.drive("delay", results.train, joint, 1e3).evidence()
        values[f"ur10e_delay_ms_{joint}"] = delay.value
        values |= {f"ur10e_delay_ms_{joint}_low": delay.low, f"ur10e_delay_ms_{joint}_high": delay.high}
    for gains, suffix in (("found", ""), ("quoted", "_quoted")):
        for pair in chosen(results["loads"], gains=gains)["pair"]:
            its = results.load(pair, gains).evidence()
            name = "ur10e_load_kg" + suffix + ("" if pair == "all pairs" else f"_{pair.replace('-', '_')}")
            low, value, high = (
                results.of_load.known_kg * (1.0 + one / 100.0) for one in (its.low, its.value, its.high)
            )
            values |= {name: value, f"{name}_low": low, f"{name}_high": high}
    for number, log in enumerate(results.load_logs, 1):
        its = results.carried_error(log).evidence()
        name = f"ur10e_load_carried_{number}"
        values |= {f"{name}_kg": results.settled(log)["mass_kg"].mean(), f"{name}_error_percent": its.value}
        if its.n >= FEWEST_BLOCKS:
            values |= {f"{name}_error_percent_low": its.low, f"{name}_error_percent_high": its.high}
    values["ur10e_urdf_difference_n_m"] = results["written"]["difference_n_m"].max()
    return values


def model_words(key: tuple[str, str]) -> str:
    """`Cov, viscous, Coulomb`."""
    model, friction = key
    return ", ".join(filter(None, (public_names.DYNAMICS_MODELS[model], public_names.FRICTIONS[friction])))


def ur10e_evidence(results: Ur10eResults) -> dict[str, Found]:
    """By the names of the claims."""
    return _models(results) | _drives(results) | _load(results) | _written(results)


def _cases(drawn: Mapping[str, Drawn]) -> dict[str, Evidence]:
    """Intervals that hold together."""
    return {name: one.evidence(len(drawn)) for name, one in drawn.items()}


def _joint_names(results: Ur10eResults) -> list[str]:
    return [f"joint {joint}" for joint in results.joints]


def _models(results: Ur10eResults) -> dict[str, Found]:
    test, part = results.test, results.tested
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
        "over_networks": _cases({public_names.DYNAMICS_MODELS[key[0]]: apart(key) for key in RIVALS}),
        "coulomb_factor": _cases({public_names.DYNAMICS_MODELS[model]: ratio(model) for model in STRICT}),
        "errors": _cases(dict(zip(joints, results.joint_error(part), strict=True))),
        "further_errors": _cases(further) or unknown("no further motion is long enough"),
        "level": _cases(dict(zip(joints, level, strict=True))),
    }


def _drives(results: Ur10eResults) -> dict[str, Found]:
    train, gains = results.train, results["gains"].set_index("joint")
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
