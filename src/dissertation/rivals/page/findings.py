"""Findings on rivals, on the board and past spheres, over people of studies; margins stand in the claims."""

from collections.abc import Sequence

import pandas as pd

from dissertation.evidence.results import Population, Register, Results
from dissertation.rivals.protocol import AS_DEMONSTRATED, KNOCKED, MODELS, NOMINAL, OURS, RIVALS
from dissertation.rivals.reaching.reaching_protocol import FAR, UNSEEN
from structlearn.palette import BLUE, GREY, OCHRE, PINK, Look
from structlearn.reporting.evidence import geometric_mean, maximum, mean
from structlearn.reporting.findings import Findings

STUDY, CHOICES = "rivals/people", "rivals/choice"
LONGER, VARIANT = "rivals/longer", "longer"
REACHING, REACHING_CHOICES = "rivals/reaching", "rivals/reaching_choice"
LOOKS = {
    NOMINAL: Look("no feedback", GREY),
    OURS: Look("primitives with feedback", BLUE),
    "feedforward": Look("behaviour cloning", OCHRE),
    "chunking": Look("action-chunking transformer", PINK),
}
AVOIDING = LOOKS | {
    NOMINAL: Look("no avoidance", GREY),
    OURS: Look("primitives with avoidance", BLUE),
}
DEMONSTRATED, NEW_TILTS = (2.5, 5.0, 7.5, 10.0), (6.3, 8.8)  # degrees
BEYOND = ("start beyond", "goal beyond")
BOARD, TRAINING, SPHERES = Register(), Register(), Register()
finding, spheres_finding = BOARD.finding, SPHERES.finding

Samples = dict[str, pd.Series]  # one value per person, by method


def findings(board: Results, longer: Results, spheres: Results) -> Findings:
    """All findings, each over the people of its study; `longer` has models `feedforward, longer`, ... too."""
    find = Findings("people")
    for register, results in ((BOARD, board), (TRAINING, longer), (SPHERES, spheres)):
        register.evaluate(find, Population(results, results, None))
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
    return over_rivals(by_level(results, settings=NEW_TILTS))


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
    """Each person's mean distance from the goal over situations; the largest."""
    tilts, parts = (0.0, *DEMONSTRATED, *NEW_TILTS), (AS_DEMONSTRATED, *BEYOND)
    found = with_all(by_level(results, "goal", tilts, parts))
    return {LOOKS[one].name: found[one] for one in (OURS, *RIVALS)}


@TRAINING.finding(geometric_mean)
def longer_training(results: Results) -> Samples:
    """Cost of rivals with all demonstrations after four times as many training steps over that before."""
    costs = with_all(by_level(results))
    return {LOOKS[one].name: costs[f"{one}, {VARIANT}"] / costs[one] for one in RIVALS}


@TRAINING.finding(geometric_mean)
def against_longer(results: Results) -> Samples:
    """Cost of ours over that of rivals trained four times as long, all with all demonstrations."""
    costs = with_all(by_level(results))
    return {LOOKS[one].name: costs[OURS] / costs[f"{one}, {VARIANT}"] for one in RIVALS}


def hits(results: Results) -> pd.DataFrame:
    """Unseen spheres hit, in %: a row per person, columns model and level (demonstrations per place)."""
    return 100.0 * results.wide("hit", ["model", "level"], part=UNSEEN)


def past_spheres(results: Results, quantity: str, part: str) -> Samples:
    """A quantity of each method with all demonstrations."""
    found = with_all(results.wide(quantity, ["model", "level"], part=part))
    return {AVOIDING[one].name: found[one] for one in (OURS, *RIVALS)}


@spheres_finding(mean, unit="%")
def unseen_hits(results: Results) -> Samples:
    """Unseen spheres hit with all demonstrations, and without avoidance."""
    found = with_all(hits(results))
    return {AVOIDING[one].name: found[one] for one in MODELS}


@spheres_finding(mean, unit="% of unseen spheres", headline=True)
def more_hits(results: Results) -> Samples:
    """Unseen spheres hit by rivals less those hit by ours, with all demonstrations."""
    found = with_all(hits(results))
    return {LOOKS[one].name: found[one] - found[OURS] for one in RIVALS}


@spheres_finding(mean, unit="% of unseen spheres")
def more_hits_with_four(results: Results) -> Samples:
    """Unseen spheres hit by rivals with four demonstrations per place less those hit by ours with one."""
    found = hits(results)
    return {LOOKS[one].name: found[one, 4.0] - found[OURS, 1.0] for one in RIVALS}


@spheres_finding(mean, unit="mm")
def reaching_goal(results: Results) -> Samples:
    """Mean distance from the goal at the end of reaches past unseen spheres."""
    return past_spheres(results, "goal", UNSEEN)


@spheres_finding(mean, unit="mm")
def needless_detour(results: Results) -> Samples:
    """Mean over far spheres of the largest distance from the reach without avoidance at equal times."""
    return past_spheres(results, "detour", FAR)
