"""The section on refining the feedback models by trial."""

from collections.abc import Callable

import pandas as pd
from matplotlib.figure import Figure as Picture

from structlearn.primitives.kernels import KERNEL_COUNT
from structlearn.reporting.page import Block, Link, Links, Prose, Section, Sizes, Table, beside
from structlearn.reporting.prose import counted, with_interval, with_spread
from structlearn.testbeds.scraping.page import refinement_figures, refinement_prose, refinement_snapshots
from structlearn.testbeds.scraping.page.board_sections import hand_roll_table
from structlearn.testbeds.scraping.page.feedback_results import FeedbackResults
from structlearn.testbeds.scraping.page.refinement_figures import LOOKS, METHODS, role
from structlearn.testbeds.scraping.page.refinement_results import RefinementResults
from structlearn.testbeds.scraping.protocol.executed_sets import AFTER, BEFORE

ABLATIONS = Link(
    "../ablations/index.html",
    "Ablations",
    "fewer samples, other covariances, one and eight added executions; written by `make ablations`",
)
RECORDING = Link(
    "../recordings/scraping/refinement.rrd",
    "refinement.rrd",
    "executions before and after refinement, with what the fingers feel",
)

ROLES = (
    "Default: the level board. Learned: from people's corrections. Refined: where the robot tried. Unseen: "
    "neither of these."
)


def pictures(results: FeedbackResults) -> dict[str, Picture]:
    """Figures of the section by name, as far as the data go."""
    made = {
        "refinement_learning": refinement_figures.learning_figure(results),
        "refinement_cost": refinement_figures.cost_figure(results),
    }
    if results.refinement.evaluated:
        made["refinement_snapshots"] = refinement_snapshots.snapshots_figure(results)
    if results.refinement.searched_primitives:
        made["search_efficiency"] = refinement_figures.search_figure(results)
    return made


def refinement(results: FeedbackResults, sizes: Sizes) -> Section:
    """Reinforcement learning of the feedback models, and what comes of it."""
    own = results.refinement
    blocks: list[Block] = [
        Prose(refinement_prose.what(results)),
        Table(
            _steps(results),
            "The refinement of one primitive (algorithm IV.3), step by step.",
            headings={"step": "", "what": "what happens", "here": "here"},
        ),
        Table(_departures(own), "Where this departs from the text, and why."),
        beside(
            "refinement_learning",
            sizes,
            "As figure IV.19: cost over the iterations; iteration 0 is before refinement. Blue: executions "
            "with the network, which meet the same conditions in every iteration. Between two of them, grey: "
            "the policies drawn in this iteration; orange: executions of the policy improved by them.",
            "Cost with the network, of samples and of improved policies over the iterations, per primitive.",
        ),
        Prose(refinement_prose.converged(results)),
        beside(
            "refinement_cost",
            sizes,
            f"As figure IV.20: accumulated cost, mean ± std over {counted(own.runs, 'run')}. {ROLES}",
            "Bars of accumulated cost per setting without feedback, before and after, a panel per primitive.",
        ),
        Prose(refinement_prose.costs(results)),
        Table(
            _costs(results),
            f"Accumulated cost in rad, mean ± std over {counted(own.runs, 'run')} of new conditions. Runs of "
            "equal number meet equal conditions before and after: lower by is their mean difference with its "
            "95 % confidence interval.",
            formats={"ratio": ".2f"},
            headings={
                "setting": "board",
                "role": "",
                "ratio": "after / before",
                "lower": "lower by (rad)",
                "verdict": "after is",
            },
            source="tables/refinement_cost_ratios.csv",
        ),
    ]
    if own.evaluated:
        blocks += _at_the_refined_tilt(results, sizes)
    if own.searched_primitives:
        blocks += _search(results, sizes)
    blocks += [Links((ABLATIONS,)), Prose(refinement_prose.failures(own))]
    if len(own.faults):
        blocks.append(
            Table(
                own.faults,
                "Rollouts that failed, by their fault; … stands for a number.",
                source="tables/refinement_faults.csv",
            )
        )
    return Section("Refinement by trial", tuple(blocks), simulated=True)


def _steps(results: FeedbackResults) -> pd.DataFrame:
    own = results.refinement
    parameters = own.parameters
    explored = _each(own, lambda name: f"{parameters.scales[name].exploration:g}")
    enough = _each(own, lambda name: f"{parameters.scales[name].threshold_rad:g} rad")
    search = parameters.search
    rows = [
        (
            "Execute with the network; stop if the norm of its cost, the root of the summed squares, is low "
            "enough.",
            f"{counted(parameters.evaluation_runs, 'run')} per iteration; enough: {enough}; at most "
            f"{counted(parameters.iterations, 'iteration')}",
        ),
        (
            "Compress what the network did into an open-loop policy: the same correction on average, as a "
            "curve over the phase that feels nothing.",
            f"{KERNEL_COUNT} weights",
        ),
        (
            "Draw policies around it, execute each, and move the policy towards those that cost less "
            "(PI2-CMA, algorithm IV.4).",
            f"K = {search.samples} policies; std of their weights at first: {explored}",
        ),
        (
            "Execute the improved policy; add what was felt and done to the demonstrations.",
            counted(parameters.added_runs, "execution"),
        ),
        (
            "Train the network on demonstrations and additions together, lest it forget; back to 1.",
            f"{parameters.training.steps} steps from the network before refinement",
        ),
    ]
    return pd.DataFrame(
        [(f"{step}.", *row) for step, row in enumerate(rows, start=1)], columns=["step", "what", "here"]
    )


def _each(own: RefinementResults, value: Callable[[str], str]) -> str:
    """`15 (turn), 5 (scrape)`."""
    return ", ".join(f"{value(name)} (“{name}”)" for name in own.refined)


def _departures(own: RefinementResults) -> pd.DataFrame:
    parameters, search = own.parameters, own.parameters.search
    rows = []
    if parameters.added_runs > 1:
        rows.append(
            (
                "1 execution of the improved policy is added (the author's public code: 8)",
                counted(parameters.added_runs, "execution"),
                "No two executions feel the same. The more there are, the less the network mistakes how the "
                "tool happened to be held for the tilt.",
            )
        )
    if search.temperature is None:
        rows.append(
            (
                "A temperature λ turns costs into weights of the policies; its value is not given",
                "λ from a bound, at every time step: the weights diverge from equal ones by "
                f"{search.kl_bound:g} nat (KL); costs relative to their range",
                "The bound needs no tuning to the size of the costs, which differs between primitives.",
            )
        )
    if search.covariance.mode == "rescaled":
        unknowns = KERNEL_COUNT * (KERNEL_COUNT + 1) // 2
        rows.append(
            (
                "The covariance of the next policies is estimated anew from the good ones",
                "Only its size follows them, its shape is kept",
                f"{search.samples} policies cannot tell {unknowns} numbers; chance would be taken for shape.",
            )
        )
    rows += [
        (
            "The executed path is compressed into a forcing term",
            "Its coupling term is compressed, the nominal forcing term stays",
            "The same movement; the weights then are of the size of the corrections.",
        ),
        (
            "Rollouts on a robot, 30 to 45 minutes per iteration",
            f"{len(own.history)} simulated rollouts in all",
            "Equal conditions can be repeated, so iterations and models are compared in pairs.",
        ),
    ]
    return pd.DataFrame(rows, columns=["dissertation", "here", "why"])


def _costs(results: FeedbackResults) -> pd.DataFrame:
    own = results.refinement
    costs = own.costs.set_index(["primitive", "model", "setting_deg"])
    rows = []
    for name in own.primitives:
        ratios = own.ratio(AFTER, BEFORE, name)
        for setting in own.settings_deg:
            row = {"primitive": f"{results.number(name)}. {name}", "setting": f"{setting:g}°"}
            row["role"] = role(own, setting)
            for model, (words, _) in LOOKS.items():
                row[words.removesuffix(" refinement")] = with_spread(*costs.loc[(name, model, setting)])
            found = ratios.loc[setting]
            row |= {"ratio": found["ratio"]}
            row |= {"lower": with_interval(found["lower_rad"], found["half_width"])}
            rows.append(row | {"verdict": found["verdict"]})
    return pd.DataFrame(rows)


def _at_the_refined_tilt(results: FeedbackResults, sizes: Sizes) -> list[Block]:
    """Figures IV.17 and IV.21."""
    own = results.refinement
    words = {model: label for model, (label, _) in LOOKS.items()}
    return [
        beside(
            "refinement_snapshots",
            sizes,
            "As figure IV.21, drawn from the recorded poses of one pair of simulated executions at "
            f"{own.example_deg:g}°, seen along the scraping direction; of all pairs the one whose gain is "
            "nearest the mean. Angles are to scale. In the first picture the tool is drawn lower than it is; "
            "what board and grasp give under the force is left out. Hand: its roll, 0° where the tool would "
            "be flat on the level board.",
            "Hand, tool and board before and after refinement at four moments, and the tool's edge.",
        ),
        Links((RECORDING,)),
        Table(
            hand_roll_table(own, results.primitives, words),
            f"As figure IV.17: roll of the hand at {own.example_deg:g}° board roll, in degrees. Published: "
            "one reading of a protractor each, with feedback of a model that had learned from corrections at "
            f"this tilt, which ours had not. Here: mean ± std over {counted(own.runs, 'run')}.",
            headings={"what": ""},
            source="tables/refinement_hand_roll.csv",
        ),
    ]


def _search(results: FeedbackResults, sizes: Sizes) -> list[Block]:
    own = results.refinement
    rows = []
    for name in own.searched_primitives:
        for method, (label, _) in METHODS.items():
            row = own.searched.loc[(name, method)]
            rows.append(
                {
                    "primitive": f"{results.number(name)}. {name}",
                    "method": label,
                    "searches": int(row["seeds"]),
                    "updates": int(row["updates"]),
                    "rollouts": int(row["rollouts"]),
                    "start": row["start_rad"],
                    "end": row["mean"],
                    "range": f"{row['low']:.1f} to {row['high']:.1f}",
                    "best": row["best_rad"],
                    "failed": int(row["failed"]),
                }
            )
    return [
        Prose(
            "How many rollouts does an improvement cost? PI2-CMA sees the cost of every time step, plain "
            "CMA-ES, a standard search, only the sum; it draws fewer policies per update, as its authors "
            f"propose. Both search the {KERNEL_COUNT} weights of the open-loop policy from the same start "
            f"with the same exploration, at {own.example_deg:g}°; no network is trained in between."
        ),
        beside(
            "search_efficiency",
            sizes,
            "Cost of the mean policy over the rollouts used, judged by further executions under equal "
            "conditions: mean (line) and range (shade) of the searches; a dot per update.",
            "Cost over rollouts for two searches, one panel per primitive.",
        ),
        Table(
            pd.DataFrame(rows),
            "Cost in rad, start and end of the mean policy; the best is of a single rollout of any search. "
            "Failed rollouts count as used.",
            formats={"start": ".1f", "end": ".1f", "best": ".1f"},
            headings={
                "rollouts": "rollouts per search",
                "end": "end, mean",
                "range": "end, range",
                "best": "best rollout",
                "failed": "failed, all",
            },
            source="tables/search_efficiency.csv",
        ),
        Prose(refinement_prose.search(results)),
    ]
