"""How recorded people differ: spread of their reaches between people, and from trial to trial of one person.

People who reach past boxes share some layouts, on which person and layout explain a trial together (case
`shared`). Layouts that only one person has are compared by what they cost: the logs of the straight distance
and of the cheapest path past the boxes (case `all`; `blocked`: where the straight line hits a box). Repeats
of one reach (case `repeats`) show what varies within a person when nothing else does.

Which side of a box is passed is logistic in the difference of the displacements that either side needs, as
simulated people choose (`obstacles.world.reaching_person`), with each person's own preference: `mean` is that
for the right, `within_std` pi / sqrt(3) times the scale of the choice.
"""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from dissertation.evidence.results import Results, joined_results
from dissertation.evidence.variance_shares import between_share, sums_of, trial_sums
from structlearn.avoidance.look_ahead import nearest_distance, scene_cost_to_go
from structlearn.avoidance.scene_reaches import (
    ONSET_SHARE,
    SceneLearningParameters,
    SceneReach,
    reaches_past_obstacles,
)
from structlearn.core.frames import local_frame
from structlearn.primitives.trajectory import differentiated
from structlearn.readers.demonstration import Demonstration
from structlearn.tasks.obstacles.parameters import ObstacleParameters
from structlearn.tasks.task_files import TaskFiles

PEOPLE = Path("data/people.csv")  # in the project of public sets
COLUMNS = ["quantity", "case", "of", "unit", "mean", "between_std", "within_std"]
COLUMNS += ["share", "low", "high", "people", "trials"]  # share of the variance between people, 95 %

# Spread of the log, or in the unit; lift and bow: halfway, above and left of the straight line
QUANTITIES = {
    "movement_s": ("log", "s"),
    "peak_m_s": ("log", "m/s"),
    "clearance_m": ("log", "m"),
    "lift_m": ("value", "m"),
    "bow_m": ("value", "m"),
}
REPEATED = {name: its for name, its in QUANTITIES.items() if name != "clearance_m"}
REPEATED |= {"end_m": ("value", "m")}  # per axis
SMOOTHING_HZ = 20.0  # of repeats, which last 0.6 s
LEAST_M = 1e-3  # of a clearance, whose log is taken
DISPLACEMENTS_M = np.linspace(0.0, 0.5, 501)
SHARES = np.linspace(0.0, 0.99, 100)  # that are tried for choices
NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(21)  # for integrals over a person's preference
LIKELY = 1.92  # half the 95 % quantile of chi^2 with one degree of freedom: the interval by likelihood


def people_who_differ(boxes: TaskFiles, repeats: TaskFiles) -> pd.DataFrame:
    """Table of `COLUMNS`, of the sets that are here. Raises InputError: their files cannot be read."""
    rows: list[Mapping[str, object]] = []
    if not boxes.absent:
        parameters = boxes.entry(ObstacleParameters)
        reaches, _ = reaches_past_obstacles(boxes.runs("reaches"), parameters)
        rows += spreads(trials_past_boxes(reaches, parameters))
    if not repeats.absent:
        rows += spreads_of_repeats(repeats.runs("demonstrations"))
    return pd.DataFrame(rows, columns=COLUMNS)


def trials_past_boxes(reaches: Iterable[SceneReach], parameters: SceneLearningParameters) -> pd.DataFrame:
    """Trials with `person`, `layout`, `QUANTITIES`, log `distance` and `cost`, `blocked`, `left`, `needed`.

    `needed`: displacement in m to pass on the right less that on the left; NaN if one is not possible.
    """
    rows = []
    for reach in reaches:
        path, ends = reach.in_base_frame, reach.in_base_frame[[0, -1]]
        boxes = sorted(np.round([[*box.centre, *box.half_size] for box in reach.obstacles], 3).tolist())
        cost = scene_cost_to_go(reach.obstacles, path[0], path[-1], parameters.look_ahead).at(ends[:1, :2])
        speed = np.linalg.norm(reach.path.velocity, axis=1) / reach.duration_s
        halfway = reach.path.position[(reach.path.position[:, 0] >= 0.5 * reach.goal[0]).argmax()]
        rows.append(
            {
                "person": reach.person,
                "layout": str(boxes),
                "movement_s": reach.duration_s,
                "peak_m_s": speed.max(),
                "clearance_m": max(nearest_distance(reach.obstacles, path).min(), LEAST_M),
                "lift_m": halfway[2],
                "bow_m": halfway[1],
                "distance": np.log(reach.goal[0]),
                "cost": np.log(cost.item()),
                **_side(reach, parameters.hand_radius_m),
            }
        )
    return pd.DataFrame(rows)


def spreads(trials: pd.DataFrame) -> Iterator[dict[str, object]]:
    """Rows of the table of people from `trials_past_boxes`; a case with fewer than two people has none."""
    shared = trials[trials.groupby("layout")["person"].transform("nunique") > 1]
    layouts = pd.get_dummies(shared["layout"], dtype=float)
    blocked = trials[trials["blocked"]]
    for quantity in QUANTITIES:
        yield from _spread(shared, quantity, "shared", layouts)
        if quantity != "bow_m":  # which the layout decides
            case, its = ("blocked", blocked) if quantity == "clearance_m" else ("all", trials)
            yield from _spread(its, quantity, case, its[["distance", "cost"]])
    choices = blocked.dropna(subset="needed")
    if len(set(choices["person"])) > 1:
        yield {"quantity": "side_m", "case": "blocked", "of": "value", "unit": "m"} | choice_spread(choices)


def spreads_of_repeats(runs: Iterable[Demonstration]) -> list[dict[str, object]]:
    """Rows on one person's repeats of one reach, from where speed exceeds 5 % of its peak."""
    rows = []
    for run in runs:
        smooth = differentiated(run.position, run.dt, SMOOTHING_HZ)
        speed = np.linalg.norm(smooth.velocity, axis=1)
        moving = np.flatnonzero(speed >= ONSET_SHARE * speed.max())
        path = smooth.position[moving[0] : moving[-1] + 1]
        local = (path - path[0]) @ local_frame(path[0], path[-1])
        _, bow, lift = local[(local[:, 0] >= 0.5 * local[-1, 0]).argmax()]
        rows.append((np.log(run.dt * len(path)), np.log(speed.max()), lift, bow, *path[-1]))
    values = np.array(rows)
    std = np.sqrt([*values[:, :4].var(axis=0, ddof=1), values[:, 4:].var(axis=0, ddof=1).mean()])
    means = [*np.exp(values[:, :2].mean(axis=0)), *values[:, 2:4].mean(axis=0), np.nan]
    alike = {"case": "repeats", "people": 1, "trials": len(values)}
    return [
        alike | {"quantity": name, "of": of, "unit": unit, "mean": mean, "within_std": its}
        for (name, (of, unit)), mean, its in zip(REPEATED.items(), means, std, strict=True)
    ]


def _spread(
    trials: pd.DataFrame, quantity: str, case: str, beside: pd.DataFrame
) -> Iterator[dict[str, object]]:
    """Row of a quantity of (N) trials, adjusted by least squares for what is `beside` people (N, K).

    Variance between people: that of their means less the part of trials, as in `between_share`.
    """
    several = trials.groupby("person")["person"].transform("size") > 1
    trials, beside = trials[several], beside[several]
    if len(set(trials["person"])) < 2:
        return
    of, unit = QUANTITIES[quantity]
    values = np.log(trials[quantity]) if of == "log" else trials[quantity]
    inside = beside - beside.groupby(trials["person"]).transform("mean")
    left = values - values.groupby(trials["person"]).transform("mean")
    slopes, _, rank, _ = np.linalg.lstsq(inside, left, rcond=1e-9)
    adjusted = trials[["person"]].assign(value=values - (beside - beside.mean()) @ slopes)
    rows = joined_results(trial_sums("recorded_people", "value", adjusted, "person"), {"person": str})
    sums = sums_of(Results(rows, "person"), "value")
    used = 1.0 - rank / sums["freedom"].sum()  # the adjustment takes degrees of freedom
    sums = sums.assign(within=sums["within"] / used, freedom=sums["freedom"] * used)
    share, within = between_share(sums), np.average(sums["within"], weights=sums["freedom"])
    between = max(sums["mean"].var() - within * (1.0 / sums["trials"]).mean(), 0.0)
    mean = np.exp(sums["mean"].mean()) if of == "log" else sums["mean"].mean()
    numbers = (mean, np.sqrt(between), np.sqrt(within), share.value, share.low, share.high)
    yield dict(zip(COLUMNS, (quantity, case, of, unit, *numbers, len(sums), len(trials)), strict=True))


def choice_spread(choices: pd.DataFrame) -> dict[str, object]:
    """Most likely preference for the right in m and its spreads, of trials with `person`, `left`, `needed`.

    P(left) = logistic((needed - preference) / scale), with normal preferences of people. The share between
    people is that of the variance of preference and choice, its interval by profile likelihood.
    """
    from scipy.optimize import minimize
    from scipy.special import log_expit, logsumexp

    person = pd.factorize(choices["person"])[0]
    needed, sign = choices["needed"].to_numpy(), np.where(choices["left"], 1.0, -1.0)

    def unlikelihood(point: np.ndarray, share: float) -> float:
        total = np.exp(point[1])
        scale = total * np.sqrt(3.0 * (1.0 - share)) / np.pi
        own = point[0] + total * np.sqrt(share) * NODES
        logs = np.zeros((person.max() + 1, len(NODES)))
        np.add.at(logs, person, log_expit(sign[:, None] * (needed[:, None] - own) / scale))
        return -float(logsumexp(logs, axis=1, b=WEIGHTS / WEIGHTS.sum()).sum())

    bounds = [(-0.5, 0.5), (np.log(1e-3), np.log(1.0))]
    fits = [minimize(unlikelihood, (0.0, np.log(0.1)), (share,), bounds=bounds) for share in SHARES]
    costs = np.array([fit.fun for fit in fits])
    best, likely = int(costs.argmin()), SHARES[costs <= costs.min() + LIKELY]
    preference, total = fits[best].x[0], np.exp(fits[best].x[1])
    return {
        "mean": preference,
        "between_std": total * np.sqrt(SHARES[best]),
        "within_std": total * np.sqrt(1.0 - SHARES[best]),
        "share": SHARES[best],
        "low": likely[0],
        "high": likely[-1],
        "people": person.max() + 1,
        "trials": len(choices),
    }


def _side(reach: SceneReach, hand_radius_m: float) -> dict[str, object]:
    """Whether the straight line is `blocked`; where it is worst, the side taken and what sides need."""
    along = np.linspace(0.0, 1.0, 301)[:, None] * (reach.in_base_frame[-1] - reach.start)
    distance = nearest_distance(reach.obstacles, reach.start + along)
    worst = along[distance.argmin()]
    passing = reach.path.position[(reach.path.position[:, 0] >= worst @ reach.frame[:, 0]).argmax()]
    needed = []
    for side in (-1.0, 1.0):
        tried = reach.start + worst + side * DISPLACEMENTS_M[:, None] * reach.frame[:, 1]
        free = nearest_distance((*reach.obstacles, *reach.walls), tried) >= hand_radius_m
        if reach.walls:  # behind which nobody passes
            free &= ~np.maximum.accumulate(nearest_distance(reach.walls, tried) < hand_radius_m)
        needed.append(DISPLACEMENTS_M[free.argmax()] if free.any() else np.nan)
    blocked = bool(distance.min() < hand_radius_m)
    return {"blocked": blocked, "left": bool(passing[1] > 0.0), "needed": needed[0] - needed[1]}
