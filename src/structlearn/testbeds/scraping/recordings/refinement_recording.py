"""Recording of a refinement by trial: what the robot does before and after it, and the search (IV.9.4)."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd
import rerun.blueprint as rrb

from structlearn.testbeds.scraping.recordings.executions_recording import (
    Comparison,
    send_settings,
    setting_tabs,
)
from structlearn.testbeds.scraping.recordings.search_recording import search_tab, searches, send_search
from structlearn.testbeds.scraping.recordings.shown_execution import Execution
from structlearn.testbeds.scraping.recordings.shown_runs import REFINED, UNREFINED
from structlearn.viewer.rrd import layout, origin_label, recording

BEFORE_AND_AFTER = Comparison(
    shadows={UNREFINED: REFINED},
    headings={
        "roll on board": "roll of the tool on the board (degrees; 0 is flat)",
        "hand roll": "roll of the hand (degrees; grey: of the board)",
        "coupling": "coupling term (orange: before, blue: after)",
        "cost": "cost of these single runs: tool off its nominal orientation (rad)",
        "torque": "roll torque of the board (mN m)",
    },
    rate_hz=50.0,
    distance_m=0.125,
)
"""What was done before refinement is the shadow of what is done after it, as in figure IV.21."""


def write_refinement(
    path: str | Path,
    settings: Mapping[float, Sequence[Execution]],
    history: pd.DataFrame,
    samples: pd.DataFrame,
    title: str = "Refinement",
) -> None:
    """Write a refinement as a recording.

    Each setting has a tab with the executions without feedback, before and after refinement, and each refined
    primitive one with its search, in which a step of the time line `search.ITERATION` is an iteration.

    Args:
        path: of the .rrd file.
        settings: of `shown_runs.read_refined_runs`.
        history: one row per rollout, of `policy_search.rollouts.history_rows` with `primitive`.
        samples: what was felt and done, of `policy_search.rollouts.sample_rows` with `primitive`.
        title: heading, different for every recording.
    """
    origin = origin_label([one.run for group in settings.values() for one in group])
    refined = searches(history, samples)
    tabs = [*setting_tabs(settings, BEFORE_AND_AFTER), *(search_tab(search, origin) for search in refined)]
    with recording(path, title) as stream:
        stream.send_blueprint(layout(rrb.Tabs(*tabs, active_tab=0), steps_per_s=1.0, at_end=True))
        send_settings(stream, settings, BEFORE_AND_AFTER)
        for search in refined:
            send_search(stream, search)
