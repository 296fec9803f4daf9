"""Scores of executions on the board, by primitive (IV.9.3.5, fig. IV.17, IV.18, IV.20).

The cost of an execution is the angle between the tool and its nominal orientation on the board (eq. IV.34):

    J_t = | 2 log(Q_nr,t o Q_cr,t*) |        n: nominal run at 0 degrees, c: current run

The dissertation prints the norm with a trailing 2, which is read as the Euclidean norm.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from pydantic import Field

from dissertation.scraping.world.layout import hand_roll_deg, tool_roll_deg
from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.feedback.coupling_model import CouplingModel
from structlearn.feedback.coupling_targets import Cuts, SupervisionParameters, executed_primitive, thinned
from structlearn.primitives import canonical
from structlearn.primitives.vector import VectorPrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.segments import commanded_cuts

NOMINAL = "nominal"  # executions without feedback
BEFORE, AFTER = "before", "after"
"""Executions with feedback before and after refinement by trial."""

END_S = 0.2  # s at the end of a primitive over which its final roll is averaged
SETTLED_S = 1.0
"""s from the start of a primitive after which force is scored, when contact and correction have settled; for
primitives shorter than twice this, force is scored in the second half."""

Runs = Mapping[float, Sequence[Demonstration]]
"""Executions with one model, by setting in degrees."""


class ExecutionParameters(Parameters):
    """Settings of executions, and number of runs in each, corrected or with a model."""

    settings_deg: tuple[float, ...] = Field(min_length=1)
    runs: int = Field(ge=1, le=1000)


def nominal_orientation(runs: Sequence[Demonstration]) -> np.ndarray:
    """Mean orientation of the tool on the board over nominal runs in the default setting.

    Runs have equal commanded durations. Returns (T, 4) sign-continuous unit quaternions, T of the shortest
    run. Raises InputError: a run has no tool-to-board orientation.
    """
    length = min(len(run.time) for run in runs)
    paths = np.stack([_tool_to_board(run)[:length] for run in runs], axis=1)  # (T, R, 4)
    aligned = np.where(np.sum(paths * paths[:, :1], axis=2, keepdims=True) < 0, -paths, paths)
    # within a degree or two, the normalised mean is the mean orientation
    return quaternion.sign_continuous(quaternion.normalised(aligned.mean(axis=1)))


def orientation_cost(run: Demonstration, nominal: np.ndarray) -> np.ndarray:
    """Cost at every tick (eq. IV.34) of a run with the rate and durations of the nominal runs.

    `nominal`: (T, 4) of `nominal_orientation`. Returns (T',) rad, T' the shorter of both. Raises InputError:
    the run has no tool-to-board orientation.
    """
    current = _tool_to_board(run)
    length = min(len(current), len(nominal))
    return np.linalg.norm(quaternion.difference(nominal[:length], current[:length]), axis=1)


def _tool_to_board(run: Demonstration) -> np.ndarray:
    if run.tool_to_board is None:
        raise InputError(f"{run.name}: has no tool-to-board orientation, which the cost is made of")
    return run.tool_to_board


def execution_scores(
    runs: Sequence[Demonstration], cuts: Cuts, nominal: np.ndarray, axis: np.ndarray
) -> pd.DataFrame:
    """Scores of executions in one setting, for the primitives in `cuts`; `axis`: (3,) roll axis.

    One row per `run` and `primitive`: `cost_rad`, summed over ticks (fig. IV.20); `mean_deg`, mean cost;
    `end_roll_deg`, roll of the tool relative to the board at the end, 0 if flat; `force_n`, downward force
    once settled, and its std `force_std_n`; `roll_torque_mn_m`, of the board on the tool. Force and torque
    are missing if no wrench was recorded.
    """
    rows = []
    for run in runs:
        cost, roll = orientation_cost(run, nominal), tool_roll_deg(run, axis)
        for name, table in cuts.items():
            start, end = (float(table.loc[run.name, column]) for column in ("start_s", "end_s"))
            first, last = round(start / run.dt), round(end / run.dt)
            ticks = cost[first : last + 1]
            row = {
                "run": run.name,
                "primitive": name,
                "cost_rad": float(ticks.sum()),
                "mean_deg": np.degrees(ticks.sum()) / (last - first + 1),
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


def scores(
    model: str, runs: Runs, primitives: Sequence[str], nominal: np.ndarray, parameters: SupervisionParameters
) -> pd.DataFrame:
    """`execution_scores` of one model in all settings, with `model` and `setting_deg`.

    `primitives`: names of all commanded primitives; those with feedback are scored. `nominal`: (T, 4) of
    `nominal_orientation`.
    """
    tables = []
    for setting, group in runs.items():
        cuts = commanded_cuts(group, primitives)
        scored = {name: cuts[name] for name in parameters.primitives}
        table = execution_scores(group, scored, nominal, parameters.unit_axis)
        tables.append(table.assign(model=model, setting_deg=setting))
    return pd.concat(tables, ignore_index=True)


def correction_scores(
    corrections: Runs, unrolls: Sequence[Demonstration], primitives: Sequence[str], corrected: str
) -> pd.DataFrame:
    """How a person corrects roll in the primitive `corrected`: `setting`, `run`, `half_s`, `roll_error_deg`.

    `half_s`: time from the start of the primitive until the hand has turned half of its final way from
    nominal executions in the default setting (`unrolls`). `roll_error_deg`: size of the tool's final roll
    relative to the board. Final: mean over the last `END_S`. `primitives`: names of all commanded primitives.
    """
    length = min(len(run.time) for run in unrolls)
    nominal = np.mean([hand_roll_deg(run)[:length] for run in unrolls], axis=0)
    rows = []
    for setting, runs in corrections.items():
        cuts = commanded_cuts(runs, primitives)[corrected]
        for run in runs:
            first, last = (round(float(end) / run.dt) for end in cuts.loc[run.name, ["start_s", "end_s"]])
            turned = hand_roll_deg(run)[first : last + 1] - nominal[first : last + 1]
            final = slice(last - first - round(END_S / run.dt), None)
            half = np.argmax(turned / turned[final].mean() >= 0.5) * run.dt
            error = abs(tool_roll_deg(run)[first : last + 1][final].mean())
            rows.append((setting, run.name, half, error))
    return pd.DataFrame(rows, columns=["setting", "run", "half_s", "roll_error_deg"])


def traces(
    model: str,
    runs: Runs,
    primitives: Sequence[str],
    networks: Mapping[str, CouplingModel],
    expected: Mapping[str, VectorPrimitive],
    parameters: SupervisionParameters,
) -> pd.DataFrame:
    """Sensor deviations in executions, and the coupling terms that a model's networks predict from them.

    One row per sample of every primitive with feedback: `setting_deg`, `run`, `time_s` since its start,
    `coupling` (0 without a network), `channel_00`, ..., `model` and `primitive`.
    """
    cuts = {setting: commanded_cuts(group, primitives) for setting, group in runs.items()}
    tables = []
    for name in parameters.primitives:
        for setting, run in ((setting, run) for setting, group in runs.items() for run in group):
            cut = cuts[setting][name].loc[run.name]
            time, deviation = executed_primitive(run, cut, expected[name], parameters.sensors)
            kept = thinned(time, parameters.rate_hz)
            time, duration, deviation = time[kept], time[-1], deviation[kept]
            coupling = np.zeros(len(time))
            if name in networks:
                p, u = canonical.phase(time, canonical.time_constant(duration))
                coupling = networks[name].coupling(deviation, p, u)
            columns = {"setting_deg": setting, "run": run.name, "time_s": time, "coupling": coupling}
            columns |= {f"channel_{index:02d}": values for index, values in enumerate(deviation.T)}
            tables.append(pd.DataFrame(columns | {"model": model, "primitive": name}))
    return pd.concat(tables, ignore_index=True)
