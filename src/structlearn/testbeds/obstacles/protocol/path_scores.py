"""What the paths of unrolls say beyond their scores: how far they leave their goal and their way."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from structlearn.primitives.position import PositionPrimitive
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import NO_MODEL, Situations

POSITION = ["x_m", "y_m", "z_m"]
MODEL = ["protocol", "model", "learned_from"]
PLACE = ["protocol", "obstacle", "scenario", "speed_m_s"]


def excursions(
    paths: pd.DataFrame, baseline: PositionPrimitive, situations: Mapping[str, Situations]
) -> pd.Series:
    """Largest distance in m from the goal after the prescribed time, by protocol, model and learned from.

    Args:
        paths: of `avoidance_protocols.evaluate`.
        baseline: whose goal it is.
        situations: by protocol, where the goal may move.
    """
    after = paths[paths["time_s"] >= baseline.duration]
    away = np.empty(len(after))
    for protocol in after["protocol"].unique():
        change = situations[protocol].goal_change if protocol in situations else None
        goal = baseline.goal if change is None else np.reshape(change.goals, (-1, 3))[0]
        mask = (after["protocol"] == protocol).to_numpy()
        away[mask] = np.linalg.norm(after.loc[mask, POSITION] - goal, axis=1)
    return pd.Series(away).groupby([after[key].to_numpy() for key in MODEL]).max()


def detours(paths: pd.DataFrame, baseline: PositionPrimitive) -> pd.DataFrame:
    """How far avoidance takes the hand from where it would be without, m, until the prescribed time.

    Args:
        paths: of `avoidance_protocols.evaluate`.
        baseline: whose duration it is.

    Returns:
        `mean` and `max` over situations of the largest distance of each unroll, indexed by protocol, model
        and learned from.
    """
    during = paths[paths["time_s"] <= baseline.duration]
    bare = during["model"] == NO_MODEL
    without = during[bare].set_index([*PLACE, "time_s"])[POSITION]
    others = during[~bare]
    where = pd.MultiIndex.from_frame(others[[*PLACE, "time_s"]])
    away = np.linalg.norm(others[POSITION].to_numpy() - without.loc[where].to_numpy(), axis=1)
    keys = list(dict.fromkeys([*MODEL, *PLACE]))
    largest = pd.Series(away).groupby([others[key].to_numpy() for key in keys]).max()
    return largest.groupby(level=[0, 1, 2]).agg(["mean", "max"])
