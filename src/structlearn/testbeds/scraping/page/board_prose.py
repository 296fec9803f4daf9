"""Sentences on the executions on the board; every one follows from the numbers."""

from collections.abc import Iterable

from structlearn.feedback.feedback_models import POINTWISE, UNROLLED
from structlearn.ground.metrics import BETTER, UNDECIDED, WORSE
from structlearn.reporting.prose import interval, listing
from structlearn.testbeds.scraping.page.board_results import BoardResults
from structlearn.testbeds.scraping.page.feedback_results import FeedbackResults


def tells_apart(board: BoardResults) -> str:
    """Whether the coupling term tells the settings apart."""
    parts = []
    for name, verdict in board.coupling_verdicts.items():
        rows = board.coupling[board.coupling["primitive"] == name]
        span = f"from {rows['mean'].iloc[0]:.1f} to {rows['mean'].iloc[-1]:.1f} rad".replace(
            "-", "\N{MINUS SIGN}"
        )
        open_steps = [
            f"{setting:g}°"
            for setting, low, high in zip(rows["setting_deg"], rows["low"], rows["high"], strict=True)
            if not low * high > 0.0
        ][1:]
        words = {
            BETTER: "changes one way with the tilt and parts every setting from its neighbours",
            UNDECIDED: "changes one way with the tilt, but the interval of the step to "
            f"{listing(open_steps)} includes zero",
            WORSE: "does not change one way with the tilt",
        }[verdict]
        parts.append(f"in “{name}” it {words} ({span})")
    return (
        f"Does the model tell the tilts apart? Mean coupling term over the primitive: {'; '.join(parts)}. "
        "Steps between settings are tested by Welch's intervals over the runs."
    )


def cost(results: FeedbackResults) -> str:
    """Where feedback lowers the cost, by primitive, and what it does on the level board."""
    board = results.board
    parts = []
    for name in board.primitives:
        found = board.ratio(POINTWISE, primitive=name).loc[board.tilted_deg, "verdict"]
        groups = [
            (words, [setting for setting in board.tilted_deg if found[setting] == verdict])
            for words, verdict in (("lower", BETTER), ("not distinguishable", UNDECIDED), ("higher", WORSE))
        ]
        said = listing(
            f"{words} at {'every tilt' if len(where) == len(found) else degrees(where)}"
            for words, where in groups
            if where
        )
        parts.append(f"in “{name}” {said}")
    text = f"Cost with pointwise feedback, compared with none: {'; '.join(parts)}."
    both = board.ratio(POINTWISE)
    if 0.0 in both.index:
        level = both.loc[0.0]
        low, high = level["lower_rad"] - level["half_width"], level["lower_rad"] + level["half_width"]
        runs = board.scores[(board.scores["setting_deg"] == 0.0) & (board.scores["model"] == POINTWISE)]
        mean = runs.groupby("primitive", sort=False)["mean_deg"].mean()
        each = listing(f"{value:.1f}° in “{name}”" for name, value in mean.items())
        what = {
            WORSE: "Feedback costs something where there is nothing to correct",
            UNDECIDED: "Where there is nothing to correct feedback makes no difference that could be told",
            BETTER: "Feedback helps even where there is nothing to correct",
        }[level["verdict"]]
        text += (
            f" {what}: at 0° the cost is {level['ratio']:.1f} times that without, "
            f"a difference of {interval(-high, -low)} rad; the tool is {each} off on average."
        )
        if 0.0 not in results.seen_deg:
            text += " No model has learned from this setting."
    return text


def people(results: FeedbackResults) -> str:
    """How far a perfect imitation would get: the demonstrations' own cost."""
    board = results.board
    if not board.corrected:
        return "The largest setting was not demonstrated, so the people's own cost there is not known."
    parts = []
    for name in board.primitives:
        own = results.demonstrated_costs
        own = own.loc[own["primitive"] == name, "cost_rad"]
        fed = board.scores[
            (board.scores["primitive"] == name)
            & (board.scores["model"] == POINTWISE)
            & (board.scores["setting_deg"] == board.example_deg)
        ]["cost_rad"]
        parts.append(
            f"{own.mean():.0f} ± {own.std():.0f} rad in “{name}” (with feedback: {fed.mean():.0f} ± "
            f"{fed.std():.0f})"
        )
    return (
        f"What is left is mostly not the model's: the corrected demonstrations at {board.example_deg:g}° "
        f"cost {listing(parts)}. People see the tilt late and take their time, and a model that imitates "
        "them does too."
        if _near(results)
        else f"The corrected demonstrations at {board.example_deg:g}° cost {listing(parts)}."
    )


def pointwise_or_unrolled(results: FeedbackResults) -> str:
    """Which way of training is better, on the board and on recorded sensors."""
    board = results.board
    between = board.ratio(UNROLLED, POINTWISE)["verdict"]
    better = [setting for setting in between.index if between[setting] == BETTER]
    worse = [setting for setting in between.index if between[setting] == WORSE]
    if better and worse:
        judged = f"lowers the cost at {degrees(better)} and raises it at {degrees(worse)}: neither is better"
    elif better or worse:
        what, where = ("lowers", better) if better else ("raises", worse)
        judged = f"{what} the cost at {degrees(where)}"
        judged += " and makes no difference that could be told elsewhere" if len(where) < len(between) else ""
    else:
        judged = "makes no difference that could be told at any setting: undecided"
    paths = board.path_comparison(results.seen_deg)
    decided = [
        f"{row.verdict} in “{row.primitive}” on settings {'' if row.seen else 'not '}learned from"
        for row in paths.itertuples()
        if row.verdict != UNDECIDED
    ]
    rest = "" if len(decided) == len(paths) else "; elsewhere no difference could be told"
    found = f"is {listing(decided)}{rest}" if decided else "is not distinguishable"
    return (
        f"Pointwise or in the unroll? On the board, training in the unroll {judged}. Given the recorded "
        f"sensors, its path {found}."
    )


def degrees(settings: Iterable[float]) -> str:
    """`2.5°, 5° and 10°`."""
    return listing(f"{setting:g}°" for setting in settings)


def _near(results: FeedbackResults) -> bool:
    """Whether most of the cost with feedback in the largest setting is in the demonstrations too."""
    board = results.board
    fed = board.scores[
        (board.scores["model"] == POINTWISE) & (board.scores["setting_deg"] == board.example_deg)
    ]
    own = results.demonstrated_costs.groupby("primitive")["cost_rad"].mean().sum()
    return own > 0.5 * fed.groupby("primitive")["cost_rad"].mean().sum()
