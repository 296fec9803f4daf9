"""What the page of the UR10e shows: numbers with intervals from the stage's tables, and its metrics."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from structlearn.ground.artefacts import Metrics
from structlearn.ground.block_bootstrap import block_count, block_sums, drawn_counts, percentiles
from structlearn.reporting.claims import Evidence, confidence
from structlearn.rigid_body.motion import drawn_nmse
from structlearn.testbeds.recorded import names
from structlearn.testbeds.recorded.page.parts.arm_figures import errors_by_joint
from structlearn.testbeds.recorded.protocol.arm_parameters import RecordedUr10eParameters

BEST, BOUNDS = ("cov", "coulomb"), ("least_squares", "coulomb")
"""The model that is judged, and that which no body bounds."""

FEWEST_BLOCKS = 3
"""An interval over fewer says nothing."""


@dataclass(frozen=True)
class Drawn:
    """A number with what the bootstrap drew for it.

    Attributes:
        value: of the whole.
        draws: (D,).
        n: blocks that were drawn from.
    """

    value: float
    draws: np.ndarray
    n: int

    def evidence(self, comparisons: int = 1) -> Evidence:
        """The number with its interval, as claims take it."""
        low, high = percentiles(self.draws, confidence(comparisons))
        return Evidence(float(self.value), float(low), float(high), self.n)


@dataclass(frozen=True)
class Ur10eResults:
    """All that the page shows.

    Attributes:
        tables: of the stage, by their names in `files.SETS`.
        chosen: parameters that it was made with.
    """

    tables: Mapping[str, pd.DataFrame]
    chosen: RecordedUr10eParameters

    def __getitem__(self, name: str) -> pd.DataFrame:
        return self.tables[name]

    @cached_property
    def parameters(self) -> RecordedUr10eParameters:
        """Those chosen, with the logs that were there in place of missing ones."""
        drives, asked = self["drives"], self["errors"]["part"]
        rest = drives.loc[drives["quantity"] == "gain at rest", "log"].tolist()
        update = {
            "rest": rest[0] if rest else None,
            "train": chosen(drives, quantity="delay")["log"].iloc[0],
            "test": asked[asked != "train"].iloc[0],
        }
        return self.chosen.model_copy(update=update)

    @property
    def joints(self) -> list[int]:
        """From 1."""
        return self["gains"]["joint"].tolist()

    @property
    def further(self) -> list[str]:
        """Logs that were asked about beside the test."""
        known = ("train", self.parameters.test)
        return [part for part in self["blocks"]["part"].unique() if part not in known]

    @cached_property
    def errors(self) -> dict[str, pd.DataFrame]:
        """`errors_by_joint` by part."""
        return {part: errors_by_joint(self["errors"], part) for part in self["errors"]["part"].unique()}

    @property
    def test(self) -> pd.DataFrame:
        """Errors on the test."""
        return self.errors[self.parameters.test]

    def nmse(self, part: str, model: tuple[str, str]) -> tuple[np.ndarray, np.ndarray, int]:
        """NMSE (n,) of a model on a part, the same of drawn blocks (D, n), and the number of blocks."""
        blocks = self.parameters.intervals
        return drawn_nmse(chosen(self["blocks"], part=part), model, blocks.draws, blocks.seed)

    def joint_error(self, part: str) -> list[Drawn]:
        """NMSE of the model that is judged, by joint."""
        values, draws, count = self.nmse(part, BEST)
        return [Drawn(value, its, count) for value, its in zip(values, draws.T, strict=True)]

    def load(self, pair: str, gains: str) -> Drawn:
        """Error of the load in percent."""
        true, keys = self.parameters.load_kg, {"pair": pair, "gains": gains}
        whole = chosen(self["loads"], **keys).iloc[0]
        draws = chosen(self["load_draws"], **keys)["mass_kg"].to_numpy()
        return Drawn(100.0 * (whole["mass_kg"] / true - 1.0), 100.0 * (draws / true - 1.0), whole["blocks"])

    def load_kg(self, error: Evidence) -> tuple[float, float, float]:
        """Low end, value and high end in kg of an error in percent."""
        low, value, high = (1.0 + 0.01 * end for end in (error.low, error.value, error.high))
        true = self.parameters.load_kg
        return true * low, true * value, true * high

    @property
    def load_logs(self) -> list[str]:
        """Logs with the load, in order."""
        return list(dict.fromkeys(self["carried"]["log"]))

    def settled(self, log: str) -> pd.DataFrame:
        """What was found while the load was carried, after the wait."""
        its = chosen(self["carried"], log=log, stage="with the load")
        return its[its["since_s"] > self.parameters.carried.settled_s]

    def carried_error(self, log: str) -> Drawn:
        """Mean absolute error of the load in percent, while it is carried; no draws where that is short."""
        carried, blocks = self.parameters.carried, self.parameters.intervals
        error = 100.0 * np.abs(self.settled(log)["mass_kg"].to_numpy() / self.parameters.load_kg - 1.0)
        length = round(carried.memory_s * self.parameters.rate_hz / carried.batch)
        count = block_count(len(error), length)
        if count < FEWEST_BLOCKS:
            return Drawn(error.mean() if len(error) else np.nan, np.array([np.nan]), count)
        sums = block_sums(np.stack([error, np.ones_like(error)], axis=1), length)
        drawn = drawn_counts(count, blocks.draws, blocks.seed) @ sums
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
    test, parameters = results.test, results.parameters
    values: Metrics = {}
    for joint, found in zip(results.joints, results.joint_error(parameters.test), strict=True):
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
        delay = results.drive("delay", parameters.train, joint, 1e3).evidence()
        values[f"ur10e_delay_ms_{joint}"] = delay.value
        values |= {f"ur10e_delay_ms_{joint}_low": delay.low, f"ur10e_delay_ms_{joint}_high": delay.high}
    for gains, suffix in (("found", ""), ("quoted", "_quoted")):
        for pair in chosen(results["loads"], gains=gains)["pair"]:
            its = results.load(pair, gains).evidence()
            name = "ur10e_load_kg" + suffix + ("" if pair == "all pairs" else f"_{pair.replace('-', '_')}")
            low, value, high = (
                parameters.load_kg * (1.0 + one / 100.0) for one in (its.low, its.value, its.high)
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
    return ", ".join(filter(None, (names.DYNAMICS_MODELS[model], names.FRICTIONS[friction])))
