"""What executions on the board achieve, primitive by primitive (IV.9.3.5, fig. IV.17, IV.18, IV.20).

The cost of an execution is how far the tool is off its nominal orientation on the board (eq. IV.34):

    J_t = | 2 log(Q_nr,t o Q_cr,t*) |        n: nominal run at 0 degrees, c: current run

The dissertation prints the norm with a trailing 2: read as the Euclidean norm.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.metrics import mean_interval
from structlearn.core.params import Parameters
from structlearn.feedback.coupling_model import CouplingModel
from structlearn.feedback.coupling_targets import Cuts, SupervisionParameters, executed_primitive
from structlearn.primitives import canonical
from structlearn.primitives.vector import VectorPrimitive
from structlearn.readers.demonstration import Demonstration


def nominal_orientation(runs: Sequence[Demonstration]) -> np.ndarray:
    """Orientation of the tool on the board in the default setting, mean over runs.

    `runs`: nominal executions in the default setting, of equal commanded durations. Returns (T, 4) unit
    quaternions, sign-continuous; T of the shortest run. Raises InputError: a run has no tool-to-board
    orientation.
    """
    length = min(len(run.time) for run in runs)
    paths = np.stack([_tool_to_board(run)[:length] for run in runs], axis=1)  # (T, R, 4)
    aligned = np.where(np.sum(paths * paths[:, :1], axis=2, keepdims=True) < 0, -paths, paths)
    # over a degree or two the normalised mean is the mean orientation
    return quaternion.sign_continuous(quaternion.normalised(aligned.mean(axis=1)))


def orientation_cost(run: Demonstration, nominal: np.ndarray) -> np.ndarray:
    """Cost at every tick.

    `run`: the current execution, on the clock of the nominal runs and of the same durations. `nominal`:
    (T, 4) of `nominal_orientation`. Returns (T',) rad, T' the shorter of both. Raises InputError: the run has
    no tool-to-board orientation.
    """
    current = _tool_to_board(run)
    length = min(len(current), len(nominal))
    return np.linalg.norm(quaternion.difference(nominal[:length], current[:length]), axis=1)


def accumulated(cost: np.ndarray, segment: tuple[float, float], rate_hz: float) -> float:
    """Sum of the cost over the ticks of one primitive (fig. IV.20), rad.

    `cost`: (T,) rad. `segment`: start and end of the primitive in s.
    """
    first, last = (round(end * rate_hz) for end in segment)
    return float(cost[first : last + 1].sum())


def _tool_to_board(run: Demonstration) -> np.ndarray:
    if run.tool_to_board is None:
        raise InputError(f"{run.name}: has no tool-to-board orientation, which the cost is made of")
    return run.tool_to_board


END_S = 0.2  # s at the end of a primitive over which its final roll is taken
SETTLED_S = 1.0
"""s after the start of a primitive from which force is judged: contact and correction are over; of one
that takes less than twice this the second half."""


def execution_scores(
    runs: Sequence[Demonstration], cuts: Cuts, nominal: np.ndarray, axis: np.ndarray
) -> pd.DataFrame:
    """Scores of executions in one setting.

    `cuts`: of these runs, for the primitives that are scored. `nominal`: (T, 4) of
    `nominal_orientation`. `axis`: (3,) roll axis.

    Returns:
        One row per run and primitive: `run`, `primitive`; `cost_rad`, accumulated over ticks; `mean_deg`, its
        mean; `end_roll_deg`, roll of the tool relative to the board at the end, 0 when flat; `force_n`,
        downward force once settled, and its std `force_std_n`; `roll_torque_mn_m`, of the board on the tool.
        Force and torque are missing where no wrench was recorded.
    """
    rows = []
    for run in runs:
        cost = orientation_cost(run, nominal)
        roll = np.degrees(quaternion.rotation_vector(run.signal("tool_to_board")) @ axis)
        for name, table in cuts.items():
            start, end = (float(table.loc[run.name, column]) for column in ("start_s", "end_s"))
            last = round(end / run.dt)
            total = accumulated(cost, (start, end), 1.0 / run.dt)
            row = {
                "run": run.name,
                "primitive": name,
                "cost_rad": total,
                "mean_deg": np.degrees(total) / (last - round(start / run.dt) + 1),
                "end_roll_deg": roll[last - round(END_S / run.dt) : last + 1].mean(),
            }
            if run.wrench is not None:
                settled_from = min(start + SETTLED_S, 0.5 * (start + end))
                settled = run.wrench[round(settled_from / run.dt) : last + 1]
                row |= {
                    "force_n": -settled[:, 2].mean(),
                    "force_std_n": settled[:, 2].std(),
                    "roll_torque_mn_m": -1e3 * (settled[:, 3:] @ axis).mean(),
                }
            rows.append(row)
    return pd.DataFrame(rows)


def cost_ratios(scores: pd.DataFrame, model: str, baseline: str = "nominal") -> pd.DataFrame:
    """Accumulated cost with feedback relative to the nominal runs, by setting.

    `scores`: rows of `execution_scores` with `model` and `setting_deg`; runs of equal name are pairs, they
    met equal conditions. Returns one row per setting: `setting_deg`, `ratio` of the mean costs over all
    scored primitives, and the mean paired difference `lower_rad` (baseline minus model) with the half width
    of its 95 % interval.
    """
    totals = scores.groupby(["model", "setting_deg", "run"])["cost_rad"].sum()
    rows = []
    for setting in sorted(scores["setting_deg"].unique()):
        ours, theirs = totals[model, setting], totals[baseline, setting]
        lower, half_width = mean_interval((theirs - ours).to_numpy())
        rows.append((setting, ours.mean() / theirs.mean(), lower, half_width))
    return pd.DataFrame(rows, columns=["setting_deg", "ratio", "lower_rad", "half_width"])


def feedback_traces(
    runs: Mapping[float, Sequence[Demonstration]],
    cuts: Mapping[float, pd.DataFrame],
    expected: VectorPrimitive,
    network: CouplingModel | None,
    parameters: SupervisionParameters,
) -> pd.DataFrame:
    """Sensor deviations of one primitive in executions, and the coupling term that a model makes of them.

    `runs`: executions by setting. `cuts`: the primitive's segments by setting. `network`: the model; None
    where there was no feedback. Returns one row per sample: `setting_deg`, `run`, `time_s`, `coupling`
    (0 without a model), `channel_00`.
    """
    tables = []
    for setting, group in runs.items():
        for run in group:
            time, deviation = executed_primitive(
                run, cuts[setting].loc[run.name], expected, parameters.sensors
            )
            kept = slice(None, None, max(1, round(1.0 / (parameters.rate_hz * run.dt))))
            time, duration, deviation = time[kept], time[-1], deviation[kept]
            coupling = np.zeros(len(time))
            if network is not None:
                p, u = canonical.phase(time, canonical.time_constant(duration))
                coupling = network.coupling(deviation, p, u)
            channels = {f"channel_{index:02d}": values for index, values in enumerate(deviation.T)}
            keys = {"setting_deg": setting, "run": run.name, "time_s": time, "coupling": coupling}
            tables.append(pd.DataFrame(keys | channels))
    return pd.concat(tables, ignore_index=True)


NOMINAL = "nominal"  # Name of the executions without feedback
BEFORE, AFTER = "before", "after"
"""Names of the executions with feedback before and after refinement by trial."""


class EvaluationParameters(Parameters):
    """Executions for the evaluation."""

    settings_deg: tuple[float, ...] = Field(min_length=1)
    runs: int = Field(ge=1)


@dataclass(frozen=True)
class ExecutedSet:
    """Executions with one model, or without."""

    model: str  # its name, or `NOMINAL`
    networks: Mapping[str, CouplingModel]  # its networks by primitive; none without feedback
    runs: Mapping[float, Sequence[Demonstration]]  # by setting in degrees
    cuts: Mapping[float, Cuts]  # of these runs by setting


def scores(
    sets: Sequence[ExecutedSet], nominal_orientation: np.ndarray, parameters: SupervisionParameters
) -> pd.DataFrame:
    """Rows of `execution_scores` with `model` and `setting_deg`, of the primitives with feedback.

    `nominal_orientation`: (T, 4).
    """
    tables = []
    for executed in sets:
        for setting, runs in executed.runs.items():
            cuts = {name: executed.cuts[setting][name] for name in parameters.primitives}
            table = execution_scores(runs, cuts, nominal_orientation, parameters.unit_axis)
            tables.append(table.assign(model=executed.model, setting_deg=setting))
    return pd.concat(tables, ignore_index=True)


def traces(
    sets: Sequence[ExecutedSet], expected: Mapping[str, VectorPrimitive], parameters: SupervisionParameters
) -> pd.DataFrame:
    """Rows of `feedback_traces` with `model` and `primitive`, for every set and primitive with feedback."""
    tables = []
    for executed in sets:
        for name in parameters.primitives:
            cuts = {setting: own[name] for setting, own in executed.cuts.items()}
            table = feedback_traces(
                executed.runs, cuts, expected[name], executed.networks.get(name), parameters
            )
            tables.append(table.assign(model=executed.model, primitive=name))
    return pd.concat(tables, ignore_index=True)
