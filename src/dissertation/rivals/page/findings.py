"""Findings on rivals over the people of the study `rivals/people`; margins stand in the claims."""

from collections.abc import Sequence

import pandas as pd

from dissertation.evidence.results import Population, Register, Results
from dissertation.rivals.protocol import AS_DEMONSTRATED, KNOCKED, NOMINAL, OURS, RIVALS
from structlearn.palette import BLUE, GREY, OCHRE, PINK, Look
from structlearn.reporting.evidence import geometric_mean, maximum, mean
from structlearn.reporting.findings import Findings

STUDY, CHOICES = "rivals/people", "rivals/choice"
LOOKS = {
    NOMINAL: Look("no feedback", GREY),
    OURS: Look("primitives with feedback", BLUE),
    "feedforward": Look("behaviour cloning", OCHRE),
    "chunking": Look("action-chunking transformer", PINK),
}
DEMONSTRATED, UNSEEN = (2.5, 5.0, 7.5, 10.0), (6.3, 8.8)  # degrees
BEYOND = ("start beyond", "goal beyond")
FINDINGS = Register()
finding = FINDINGS.finding

Samples = dict[str, pd.Series]  # one value per person, by method


def findings(results: Results) -> Findings:
    """All findings, over the study's people."""
    find = Findings("people")
    FINDINGS.evaluate(find, Population(results, results, None))
    return find


def by_level(
    results: Results,
    quantity: str = "cost",
    settings: Sequence[float] = DEMONSTRATED,
    parts: Sequence[str] = (AS_DEMONSTRATED,),
) -> pd.DataFrame:
    """Mean over settings and parts: a row per person, columns model and level (demonstrations per tilt)."""
    keys = {"setting": list(settings), "part": list(parts)}
    wide = results.wide(quantity, ["model", "level", "setting", "part"], **keys)
    return wide.T.groupby(["model", "level"]).mean().T


def with_all(values: pd.DataFrame) -> pd.DataFrame:
    """Of `by_level`, methods with all demonstrations: a row per person, a column per model."""
    return values.T.groupby("model").tail(1).droplevel("level").T


def over_rivals(values: pd.DataFrame) -> Samples:
    """Of `by_level`, value of ours over that of each rival with all demonstrations."""
    own = with_all(values)
    return {LOOKS[one].name: own[OURS] / own[one] for one in RIVALS}


@finding(geometric_mean, headline=True)
def one_against_four(results: Results) -> Samples:
    """Cost of ours with one demonstration per tilt over that of rivals with four."""
    costs = by_level(results)
    return {LOOKS[one].name: costs[OURS, 1] / costs[one, 4] for one in RIVALS}


@finding(geometric_mean, headline=True)
def all_demonstrations(results: Results) -> Samples:
    """Cost over that of rivals at demonstrated tilts."""
    return over_rivals(by_level(results))


@finding(geometric_mean)
def unseen_tilts(results: Results) -> Samples:
    """Cost over that of rivals at tilts that nobody demonstrated."""
    return over_rivals(by_level(results, settings=UNSEEN))


@finding(geometric_mean)
def knocked(results: Results) -> Samples:
    """Cost over that of rivals when the tool is knocked off the board."""
    return over_rivals(by_level(results, parts=[KNOCKED]))


@finding(geometric_mean)
def smoother(results: Results) -> Samples:
    """Jerk over that of rivals."""
    return over_rivals(by_level(results, "jerk"))


@finding(geometric_mean)
def level_harm(results: Results) -> Samples:
    """Cost on the level board over that of the primitives alone."""
    costs = with_all(by_level(results, settings=[0.0]))
    return {LOOKS[one].name: costs[one] / costs[NOMINAL] for one in (OURS, *RIVALS)}


@finding(mean, unit="% of executions")
def more_failures_beyond(results: Results) -> Samples:
    """Failures of rivals less those of ours, where start or goal is moved beyond the demonstrations."""
    failed = 100.0 * with_all(by_level(results, "failed", parts=BEYOND))
    return {LOOKS[one].name: failed[one] - failed[OURS] for one in RIVALS}


@finding(maximum, unit="mm")
def goal_distance(results: Results) -> Samples:
    """Largest mean distance from the goal over situations and people."""
    tilts, parts = (0.0, *DEMONSTRATED, *UNSEEN), (AS_DEMONSTRATED, *BEYOND)
    found = with_all(by_level(results, "goal", tilts, parts))
    return {LOOKS[one].name: found[one] for one in (OURS, *RIVALS)}
