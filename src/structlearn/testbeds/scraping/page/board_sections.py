"""Sections on the executions on the board, without and with feedback."""

from collections.abc import Mapping, Sequence

import pandas as pd

from structlearn.feedback.feedback_models import POINTWISE, UNROLLED
from structlearn.reporting.page import Block, Link, Links, Prose, Section, Sizes, Table, beside
from structlearn.reporting.prose import counted, listing, rounded, with_interval, with_spread
from structlearn.testbeds.scraping.page import board_prose
from structlearn.testbeds.scraping.page.board_results import (
    LARGEST_FORCE_ERROR_PERCENT,
    PUBLISHED_HAND_DEG,
    PUBLISHED_HAND_SETTING_DEG,
    BoardResults,
)
from structlearn.testbeds.scraping.page.execution_results import ExecutionResults
from structlearn.testbeds.scraping.page.feedback_results import FeedbackResults
from structlearn.testbeds.scraping.protocol.executed_sets import NOMINAL

PUBLISHED_WORDS = {NOMINAL: "no feedback", POINTWISE: "with feedback"}


def testbed(results: FeedbackResults, sizes: Sizes) -> Section:
    """What is simulated, and whether it does what is asked of it."""
    board = results.board
    held = "within" if board.force_error_percent <= LARGEST_FORCE_ERROR_PERCENT else "not within"
    monotone = [f"“{name}”" for name, one in board.torque_monotone.items() if one]
    turning = f"is monotone in the tilt in {listing(monotone, 'no primitive')}"
    return Section(
        "The board, the robot and the fingers",
        (
            Prose(
                "A torque-controlled KUKA iiwa in PyBullet follows the primitives by operational-space "
                "control at 300 Hz. Its compliant grasp holds a scraper with an 11 mm edge over a board "
                "whose roll is set. In primitives 2 and 3 the robot presses down with "
                f"{board.force_n:g} N, and while a person corrects it gives way about roll (table IV.4). Two "
                "fingers with 19 electrodes each are read at 100 Hz, the tool's orientation on the board "
                "is measured as by motion capture. Everything on feedback below is simulated."
            ),
            Links(
                (
                    Link(
                        "../calibration/index.html",
                        "Simulated touch beside recorded touch",
                        "statistics of both, side by side; written by `make recorded`",
                    ),
                )
            ),
            Prose(
                f"The mean force of an execution is off by {board.force_error_percent:.1f} % at most, {held} "
                f"the {LARGEST_FORCE_ERROR_PERCENT:g} % asked for, over all settings, models and runs. "
                f"Without feedback the roll torque of the board on the tool {turning}."
            ),
            Table(
                _nominal(results),
                f"Executions without feedback, means over {counted(board.runs, 'run')} per setting. Force: "
                "mean ± std within a run, from 1 s after the start of the primitive. Torque: of the board on "
                "the tool about roll. Roll: of the tool relative to the board at the primitive's end.",
                source="tables/board_nominal.csv",
            ),
            beside(
                "executions",
                sizes,
                f"One execution at {board.example_deg:g}° without feedback, and one that a person corrects. "
                "Shaded: the primitives. Touch: the channels that change most, relative to their first "
                "reading.",
                "Roll of hand, tool and board, force, roll torque and electrodes over time, of a nominal and "
                "a corrected execution.",
            ),
        ),
        simulated=True,
    )


def closed_loop(results: FeedbackResults, sizes: Sizes) -> Section:
    """The models act on the board."""
    board = results.board
    blocks: list[Block] = [
        Prose(
            f"The primitives are executed {board.runs} times per setting without feedback and with each "
            "model, in pairs: runs of equal number meet the same friction, board and noise. Two models of "
            "the same form, PMNN with 100 nodes, are tried. The pointwise one is the dissertation's: it "
            "learns sample by sample. The other goes on learning inside a differentiable unroll, so that the "
            "unrolled path follows the corrected one (future work in V.2). "
            f"Learned from: {board_prose.degrees(results.seen_deg)}; never learned from: "
            f"{board_prose.degrees(s for s in board.tilted_deg if s not in results.seen_deg)}."
        )
    ]
    for name in results.adapted:
        channel, _ = results.channels[name]
        blocks.append(
            beside(
                f"closed_loop_{name}",
                sizes,
                f"As figure IV.18, primitive {results.number(name)} (“{name}”): coupling term (top) and the "
                f"deviation of {results.channel_name(channel)} (bottom) in demonstrations and executions. "
                "The coupling terms of executions follow from the recorded deviations, before the "
                "controller's bounds.",
                "One column per setting; demonstrations, executions without and with feedback.",
            )
        )
    blocks += [
        Prose(board_prose.tells_apart(board)),
        beside(
            "board_roll",
            sizes,
            "Roll of the tool at the end of the primitives, one point per execution; on the dotted line the "
            "tool lies flat on the board.",
            "Roll of the tool over roll of the board for three models.",
        ),
        beside(
            "board_cost",
            sizes,
            "As figure IV.20, without reinforcement learning: accumulated cost, mean ± std over the runs. "
            "The cost is the angle between the tool's orientation on the board and that of nominal "
            "executions at 0°, summed over the ticks.",
            "Bars of accumulated cost per setting and model, one panel per primitive.",
        ),
        Prose(board_prose.cost(results)),
        Prose(board_prose.people(results)),
        Table(
            _ratios(board),
            "Accumulated cost of both primitives. Ratio: of the means, below 1 where feedback helps. Lower "
            "by: mean paired difference to executions without feedback, with its 95 % confidence interval. "
            "Last column: whether training in the unroll lowers the cost against pointwise training.",
            formats={"setting_deg": "g", POINTWISE: ".2f", UNROLLED: ".2f"},
            headings={
                "setting_deg": "board (°)",
                POINTWISE: "ratio, pointwise",
                "pointwise_lower": "lower by (rad)",
                UNROLLED: "ratio, in the unroll",
                "unrolled_lower": "lower by (rad)",
                "gain": "unroll against pointwise (rad)",
            },
            source="tables/board_cost_ratios.csv",
        ),
        Prose(board_prose.pointwise_or_unrolled(results)),
        Table(
            _paths(results),
            "Distance of the unrolled roll path from the demonstrated one, given the recorded sensors: rms "
            "over the movement, mean ± std over demonstrations. Settings learned from are mostly "
            "training data.",
            headings={
                POINTWISE: "pointwise (°)",
                UNROLLED: "in the unroll (°)",
                "gain": "gain (°), 95 % CI",
                "verdict": "in the unroll is",
            },
            source="tables/path_errors.csv",
        ),
        Table(
            hand_roll_table(board, results.primitives, PUBLISHED_WORDS),
            f"Figure IV.17: roll of the hand at {board.example_deg:g}° board roll, in degrees; published: "
            f"one reading of a protractor, here: mean ± std over {counted(board.runs, 'run')}. Zero is where "
            "the tool is flat on the level board; the simulated person starts with a tilted tool.",
            headings={"what": ""},
            source="tables/board_hand_roll.csv",
        ),
    ]
    return Section("On the board", tuple(blocks), simulated=True)


def _nominal(results: FeedbackResults) -> pd.DataFrame:
    board = results.board
    rows = []
    for setting in board.settings_deg:
        row = {"board (°)": f"{setting:g}"}
        for heading, columns, number_format in (
            ("force (N)", ("force_n", "force_std_n"), ".3f"),
            ("torque (mN m)", ("roll_torque_mn_m",), ".2f"),
            ("roll (°)", ("end_roll_deg",), ".1f"),
        ):
            for name in board.primitives:
                values = board.nominal.loc[(setting, name)]
                cell = " ± ".join(rounded(values[column], number_format) for column in columns)
                row[f"{name}: {heading}"] = cell
        rows.append(row)
    return pd.DataFrame(rows)


def _ratios(board: BoardResults) -> pd.DataFrame:
    rows = []
    pointwise, unrolled = board.ratio(POINTWISE), board.ratio(UNROLLED)
    between = board.ratio(UNROLLED, POINTWISE)
    for setting in board.settings_deg:
        row = {"setting_deg": setting}
        for model, table in ((POINTWISE, pointwise), (UNROLLED, unrolled)):
            found = table.loc[setting]
            row |= {
                model: found["ratio"],
                f"{model}_lower": with_interval(found["lower_rad"], found["half_width"]),
            }
        found = between.loc[setting]
        gain = with_interval(found["lower_rad"], found["half_width"])
        rows.append(row | {"gain": f"{gain}: {found['verdict']}"})
    return pd.DataFrame(rows)


def _paths(results: FeedbackResults) -> pd.DataFrame:
    rows = []
    for row in results.board.path_comparison(results.seen_deg).itertuples():
        cells = {
            model: f"{getattr(row, f'{model}_deg'):.2f} ± {getattr(row, f'{model}_std'):.2f}"
            for model in (POINTWISE, UNROLLED)
        }
        keys = {
            "primitive": f"{results.number(row.primitive)}. {row.primitive}",
            "settings": "learned from" if row.seen else "never learned from",
            "demonstrations": row.count,
        }
        gain = with_interval(row.lower_deg, row.half_width, ".3f")
        rows.append(keys | cells | {"gain": gain, "verdict": row.verdict})
    return pd.DataFrame(rows)


def hand_roll_table(
    executed: ExecutionResults,
    primitives: Sequence[str],
    words: Mapping[str, str],
) -> pd.DataFrame:
    """Rolls of the hand in degrees over the primitives, beside the protractor's of figure IV.17.

    Args:
        executed: the executions; published readings are shown if they are in the same setting.
        primitives: names of all, in order of time.
        words: for our models, by name.
    """
    columns = ["start", *(f"end of {name}" for name in primitives)]
    rows = []
    if executed.example_deg == PUBLISHED_HAND_SETTING_DEG:
        for model, own in PUBLISHED_WORDS.items():
            readings = [f"{reading:.1f}" for reading in PUBLISHED_HAND_DEG[model]]
            if len(readings) == len(columns):
                rows.append({"what": f"{own}, published"} | dict(zip(columns, readings, strict=True)))
    for model, own in words.items():
        found = executed.hand_roll[executed.hand_roll["model"] == model]
        cells = [with_spread(*reading) for reading in zip(found["mean_deg"], found["std_deg"], strict=True)]
        rows.append({"what": f"{own}, here"} | dict(zip(columns, cells, strict=True)))
    return pd.DataFrame(rows)
