"""Sentences on the refinement by trial; every one follows from the numbers."""

from structlearn.ground.metrics import BETTER, UNDECIDED, WORSE
from structlearn.policy_search.rollouts import FEEDBACK, IMPROVED
from structlearn.policy_search.sample_efficiency import CMA_ES, PI2
from structlearn.reporting.prose import capitalised, counted, listing, with_interval
from structlearn.testbeds.scraping.page.board_prose import degrees
from structlearn.testbeds.scraping.page.feedback_results import FeedbackResults
from structlearn.testbeds.scraping.page.refinement_results import PUBLISHED_ITERATIONS, RefinementResults
from structlearn.testbeds.scraping.protocol.executed_sets import AFTER, BEFORE, NOMINAL


def what(results: FeedbackResults) -> str:
    """What is refined, from what, and on what."""
    refinement = results.refinement
    own = refinement.parameters
    numbers = [f"{results.number(name)} (“{name}”)" for name in refinement.refined]
    order = (
        f"Primitive {numbers[0]} is refined"
        if len(numbers) == 1
        else f"Primitives {listing(numbers)} are refined one after the other, each with what those before it "
        "have learned"
    )
    never = (
        f" Never seen, neither in corrections nor in trials: {degrees(refinement.unseen_deg)}."
        if refinement.unseen_deg
        else ""
    )
    return (
        "On a tilt that it has not learned from, a model that imitates people can only guess. Here it goes "
        "on learning by trial and error. New models of the same form, PMNN, first learn from the corrections "
        f"at {degrees(own.settings_deg)}. Then the robot tries at {own.setting_deg:g}°, of which they know "
        "no corrections, and keeps what lowers the cost: the angle between the tool's orientation on the "
        f"board and that of nominal executions at 0°, summed over the ticks. {order}.{never} Everything here "
        "is simulated."
    )


def converged(results: FeedbackResults) -> str:
    """How the cost falls over the iterations, and whether it has stopped to."""
    refinement = results.refinement
    said = []
    for name in refinement.refined:
        costs, count = refinement.network_costs[name], refinement.iterations[name]
        many = f"over {counted(count, 'iteration')}" if count else "and nothing was tried"
        text = f"In “{name}” the cost with the network goes from {costs[0]:.1f} to {costs[-1]:.1f} rad {many}"
        rows = refinement.progress[refinement.progress["primitive"] == name].set_index("iteration")
        for iteration in rows.index[rows.index > PUBLISHED_ITERATIONS]:
            row = rows.loc[iteration]
            gain = with_interval(row["since_lower_rad"], row["since_half_width"])
            words = {
                BETTER: "proven lower than",
                WORSE: "proven higher than",
                UNDECIDED: "not distinguishable from",
            }[row["since_verdict"]]
            text += f"; iteration {iteration} is {words} iteration {PUBLISHED_ITERATIONS} (by {gain} rad)"
        said.append(f"{text}.")
    return (
        f"{' '.join(said)} Published, with K = 38: converged after {PUBLISHED_ITERATIONS} iterations in both "
        f"primitives. {_stopped(refinement)} {_follows(refinement)}"
    )


def _stopped(refinement: RefinementResults) -> str:
    parts = []
    for name in refinement.refined:
        threshold = refinement.parameters.scales[name].threshold_rad
        why = "met" if refinement.norms[name] <= threshold else "not met"
        parts.append(f"“{name}” ends at {refinement.norms[name]:.2f} rad ({threshold:g} rad {why})")
    return f"Norm of the cost and its threshold: {listing(parts)}."


def _follows(refinement: RefinementResults) -> str:
    """How near the network comes to the policy it learned from."""
    curves = refinement.curves.set_index(["primitive", "iteration", "kind"])["mean"]
    parts = []
    for name, last in refinement.iterations.items():
        if last:
            policy, network = (curves[name, last, kind] for kind in (IMPROVED, FEEDBACK))
            parts.append(f"{policy:.1f} and {network:.1f} rad in “{name}”")
    if not parts:
        return "No iteration was needed."
    return (
        f"The last improved policy and the network trained on it cost {listing(parts)}: the policy acts "
        "without feeling and fits this tilt alone, the network must tell from touch what to do."
    )


def costs(results: FeedbackResults) -> str:
    """What the refinement changes, setting by setting, with all primitives summed."""
    refinement = results.refinement
    rows = refinement.ratio(AFTER, BEFORE)
    groups = [
        ("refined on", [refinement.example_deg]),
        ("learned from", refinement.seen_deg),
        ("never seen", refinement.unseen_deg),
        ("default", [0.0]),
    ]
    parts = []
    for words, settings in groups:
        found = rows.loc[[setting for setting in settings if setting in rows.index]]
        if len(found):
            each = listing(f"{row.ratio:.2f} at {row.Index:g}° ({row.verdict})" for row in found.itertuples())
            parts.append(f"{words}: {each}")
    text = f"Cost after over cost before, all primitives summed, by setting. {capitalised('; '.join(parts))}."
    if 0.0 in rows.index:
        level = refinement.ratio(AFTER, NOMINAL).loc[0.0]
        words = {
            WORSE: "feedback still costs something, though there is nothing to correct",
            UNDECIDED: "feedback makes no difference that could be told",
            BETTER: "feedback helps, though there is nothing to correct",
        }[level["verdict"]]
        text += f" On the level board {words}: after refinement {level['ratio']:.1f} times the cost without."
    return text


def search(results: FeedbackResults) -> str:
    """Which search ends lower with the same budget, without claiming what few searches cannot show."""
    refinement = results.refinement
    parts, seeds = [], 0
    for name in refinement.searched_primitives:
        ends = {method: refinement.searched.loc[(name, method)] for method in (PI2, CMA_ES)}
        ours, theirs = ends[PI2], ends[CMA_ES]
        seeds = max(seeds, int(ours["seeds"]))
        if ours["high"] < theirs["low"]:
            words = "every search by PI2-CMA ends lower than every one by CMA-ES"
        elif theirs["high"] < ours["low"]:
            words = "every search by CMA-ES ends lower than every one by PI2-CMA"
        else:
            words = "the ranges of both overlap, no difference can be told"
        text = f"in “{name}” {words} ({ours['mean']:.1f} and {theirs['mean']:.1f} rad)"
        worse = [
            label for label, end in (("PI2-CMA", ours), ("CMA-ES", theirs)) if end["mean"] > end["start_rad"]
        ]
        parts.append(text + (f", {listing(worse)} above the start" if worse else ""))
    many = f"{seeds} searches" if seeds > 1 else "1 search"
    return (
        f"With the same budget, {'; '.join(parts)}. This is what {many} per method show, too few for a test."
    )


def failures(refinement: RefinementResults) -> str:
    """How many rollouts failed, and what becomes of them."""
    failed, total = int(refinement.faults["rollouts"].sum()), len(refinement.history)
    counts = f"{failed or 'None'} of {total} rollouts failed"
    return (
        f"{counts}. A rollout fails if the simulation diverges: a signal is not finite, or the tool is off "
        "by more than a right angle. It is reported and left out of the update and of the data, as if its "
        "cost were infinite: with any finite cost beside it all others would look alike. The refinement "
        "stops with an error if fewer than two policies of an iteration succeed."
    )
