"""The dissertation's statements on feedback, beside what is found here: rows of the table of claims."""

from collections.abc import Mapping

from structlearn.feedback.feedback_models import POINTWISE
from structlearn.feedback.model_comparison import REPRESENTATIONS
from structlearn.ground.metrics import BETTER, WORSE
from structlearn.reporting.claim_rows import HOLDS, Row
from structlearn.reporting.prose import listing
from structlearn.testbeds.scraping.page.board_results import LARGEST_FORCE_ERROR_PERCENT, BoardResults
from structlearn.testbeds.scraping.page.execution_results import weakest
from structlearn.testbeds.scraping.page.feedback_figures import plain_name
from structlearn.testbeds.scraping.page.feedback_results import MODEL_CLAIMS, FeedbackResults


def feedback_claims(results: FeedbackResults) -> list[Row]:
    """Rows on the models, where they were compared, and on the board, where they were executed."""
    rows = []
    if len(results.comparison):
        rows += [_model_claim(results, statement) for statement in MODEL_CLAIMS]
    if results.board is not None:
        rows += _board_claims(results.board)
    return rows


def holds(verdicts: Mapping[str, str]) -> str:
    """`yes`, `no` or `undecided`; by primitive where they differ."""
    words = {name: HOLDS[verdict] for name, verdict in verdicts.items()}
    if len(set(words.values())) == 1:
        return next(iter(words.values()))
    return ", ".join(f"{name}: {word}" for name, word in words.items())


def _model_claim(results: FeedbackResults, statement: str) -> Row:
    source, pairs = MODEL_CLAIMS[statement]
    shown = {name for pair in pairs for name in pair}
    errors = results.model_errors.set_index(["primitive", "representation", "stopping"])[
        "generalization_mean"
    ]
    each = [
        f"“{name}”: "
        + ", ".join(
            f"{plain_name(key)} {errors[name, key, 'validation']:.3f}"
            for key in REPRESENTATIONS
            if key in shown and (name, key, "validation") in errors.index
        )
        for name in results.adapted
    ]
    found = f"generalisation NMSE, {'; '.join(each)}; {results.folds} folds"
    return statement, source, found, holds(results.claim_verdicts(pairs))


def _board_claims(board: BoardResults) -> list[Row]:
    verdicts, found = {}, []
    for name in board.primitives:
        rows = board.ratio(POINTWISE, primitive=name).loc[board.tilted_deg]
        verdicts[name] = weakest(rows["verdict"])
        open_at = [f"{setting:g}°" for setting in rows.index if rows["verdict"][setting] != BETTER]
        found.append(
            f"“{name}”: {rows['ratio'].min():.2f} to {rows['ratio'].max():.2f} of the cost without"
            + (f", not proven lower at {listing(open_at)}" if open_at else "")
        )
    coupling = [
        f"“{name}”: mean coupling term {_span(board, name)}".replace("-", "\N{MINUS SIGN}")
        for name in board.primitives
    ]
    torque = [
        f"“{name}”: {_torque(board, name)} mN m".replace("-", "\N{MINUS SIGN}") for name in board.primitives
    ]
    held = board.force_error_percent <= LARGEST_FORCE_ERROR_PERCENT
    return [
        (
            "Feedback lowers the cost on every setting but the default",
            "Fig. IV.20",
            f"{'; '.join(found)}; {board.runs} runs each, in pairs",
            holds(verdicts),
        ),
        (
            "The coupling term of the model differs between the tilts of the board",
            "Fig. IV.18",
            f"{'; '.join(coupling)}; yes means: every step between neighbouring settings goes one way and "
            "its 95 % interval excludes zero",
            holds(board.coupling_verdicts),
        ),
        (
            f"Force control holds {board.force_n:g} N within {LARGEST_FORCE_ERROR_PERCENT:g} % at every tilt",
            "this project",
            f"largest error of the mean force of an execution {board.force_error_percent:.1f} %",
            "yes" if held else "no",
        ),
        (
            "Without feedback the roll torque is monotone in the tilt",
            "this project",
            "; ".join(torque),
            holds({name: BETTER if one else WORSE for name, one in board.torque_monotone.items()}),
        ),
    ]


def _span(board: BoardResults, primitive: str) -> str:
    rows = board.coupling[board.coupling["primitive"] == primitive]
    first, last = rows.iloc[0], rows.iloc[-1]
    return (
        f"{first['mean']:.1f} rad at {first['setting_deg']:g}° to {last['mean']:.1f} at "
        f"{last['setting_deg']:g}°"
    )


def _torque(board: BoardResults, primitive: str) -> str:
    torque = board.nominal.xs(primitive, level="primitive")["roll_torque_mn_m"]
    return f"{torque.iloc[0]:.2f} at {torque.index[0]:g}° to {torque.iloc[-1]:.2f} at {torque.index[-1]:g}°"
