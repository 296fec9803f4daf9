"""Findings on rivals over the people of the study `rivals/people`; margins stand in the claims."""

from collections.abc import Mapping, Sequence

import pandas as pd

from dissertation.evidence.results import Population, Register, Results
from dissertation.evidence.studies import OURS as PIPELINE
from dissertation.evidence.studies import Study
from dissertation.rivals.protocol import AS_DEMONSTRATED, KNOCKED, NOMINAL, OURS, RIVALS
from structlearn.palette import BLACK, BLUE, GREY, OCHRE, PINK, Look
from structlearn.reporting.evidence import geometric_mean, maximum, mean
from structlearn.reporting.findings import Findings

STUDY, WHO = "rivals/people", "person"
LOOKS = {
    NOMINAL: Look("no feedback", GREY),
    OURS: Look("primitives with feedback", BLUE),
    "feedforward": Look("behaviour cloning, feed-forward", OCHRE),
    "recurrent": Look("behaviour cloning, recurrent", BLACK),
    "chunking": Look("action-chunking transformer", PINK),
}
DEMONSTRATED, UNSEEN = (2.5, 5.0, 7.5, 10.0), (6.3, 8.8)  # degrees
BEYOND = ("start beyond", "goal beyond")
FINDINGS = Register()
finding = FINDINGS.finding

Samples = Mapping[str, pd.Series]  # one value per person, by rival


def findings(study: Study | None) -> Findings:
    """All findings, over the study's people; nothing was found if it was not run."""
    columns = [WHO, "quantity", "value", "unit", "model", "level", "setting", "part"]
    table = study.results if study else pd.DataFrame(columns=columns)
    results = Results(table[table["variant"] == PIPELINE] if study else table, WHO)
    find = Findings("people")
    FINDINGS.evaluate(find, Population(results, results, None))
    return find


def by_method(
    results: Results,
    quantity: str = "cost",
    settings: Sequence[float] = DEMONSTRATED,
    parts: Sequence[str] = (AS_DEMONSTRATED,),
) -> pd.DataFrame:
    """Mean over settings and parts: one row per person, columns model and level (demonstrations per tilt)."""
    keys = {"setting": list(settings), "part": list(parts)}
    wide = results.wide(quantity, ["model", "level", "setting", "part"], **keys)
    return wide.T.groupby(["model", "level"], sort=False).mean().T if len(wide) else pd.DataFrame()


def against(values: pd.DataFrame, own: float | None = None, theirs: float | None = None) -> Samples:
    """Value of ours over that of each rival, with so many demonstrations per tilt each; None: all."""
    if not len(values):
        return {}
    most = max(values.columns.unique("level"))
    ours = values[OURS, own or most]
    return {LOOKS[one].name: ours / values[one, theirs or most] for one in RIVALS}


@finding(geometric_mean, headline=True)
def one_against_four(results: Results) -> Samples:
    """Cost of ours with one demonstration per tilt over that of rivals with four."""
    return against(by_method(results), 1, 4)


@finding(geometric_mean, headline=True)
def all_demonstrations(results: Results) -> Samples:
    """Cost over that of rivals at demonstrated tilts."""
    return against(by_method(results))


@finding(geometric_mean)
def unseen_tilts(results: Results) -> Samples:
    """Cost over that of rivals at tilts that nobody demonstrated."""
    return against(by_method(results, settings=UNSEEN))


@finding(geometric_mean)
def knocked(results: Results) -> Samples:
    """Cost over that of rivals when the tool is knocked off the board."""
    return against(by_method(results, settings=DEMONSTRATED, parts=(KNOCKED,)))


@finding(geometric_mean)
def smoother(results: Results) -> Samples:
    """Jerk over that of rivals."""
    return against(by_method(results, "jerk"))


@finding(geometric_mean)
def level_harm(results: Results) -> Samples:
    """Cost on the level board over that of the primitives alone."""
    costs = by_method(results, settings=(0.0,))
    if not len(costs):
        return {}
    most = max(costs.columns.unique("level"))
    return {LOOKS[one].name: costs[one, most] / costs[NOMINAL, 0] for one in (OURS, *RIVALS)}


@finding(mean, unit="% of executions")
def more_failures_beyond(results: Results) -> Samples:
    """Failures of rivals less those of ours, where start or goal is moved beyond the demonstrations."""
    failed = by_method(results, "failed", parts=BEYOND)
    if not len(failed):
        return {}
    most = max(failed.columns.unique("level"))
    return {LOOKS[one].name: 100.0 * (failed[one, most] - failed[OURS, most]) for one in RIVALS}


@finding(maximum, unit="mm")
def goal_distance(results: Results) -> Samples:
    """Largest mean distance from the goal over situations and people."""
    parts = (AS_DEMONSTRATED, *BEYOND)
    found = by_method(results, "goal", (0.0, *DEMONSTRATED, *UNSEEN), parts)
    if not len(found):
        return {}
    most = max(found.columns.unique("level"))
    return {LOOKS[one].name: found[one, most] for one in (OURS, *RIVALS)}
