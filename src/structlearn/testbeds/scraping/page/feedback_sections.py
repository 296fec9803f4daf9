"""Sections on feedback: what is felt, what people corrected, and which model learns it best."""

import pandas as pd

from structlearn.feedback.folds import PARTS
from structlearn.feedback.model_comparison import dominant_features
from structlearn.ground.metrics import BETTER, WORSE
from structlearn.reporting.page import Block, Prose, Section, Sizes, Table, beside
from structlearn.reporting.prose import capitalised, counted, interval, listing
from structlearn.testbeds.scraping.page.feedback_figures import plain_name, shared_features
from structlearn.testbeds.scraping.page.feedback_results import (
    PUBLISHED_DIMENSIONS,
    PUBLISHED_NMSE,
    FeedbackResults,
)

STOPPING_NAMES = {
    "validation": "here, stopped by validation",
    "generalization": "here, best step for the one left out",
}


def expected(results: FeedbackResults, sizes: Sizes) -> Section:
    """What the fingers should feel."""
    off, spread = results.expected_errors
    channels = len(next(iter(results.expected.values())).start)
    runs = counted(len(results.unrolls), "execution")
    return Section(
        "Expected sensor traces",
        (
            Prose(
                f"The nominal primitives are executed on the level board. From {runs} one primitive of "
                f"{channels} dimensions is learned for every movement primitive, on the same canonical "
                "system (associative skill memory, IV.3): what the fingers should feel. Over all channels "
                f"and times the expected traces are {off:.1f} counts (rms) off the mean of the executions"
                + (
                    f", which differ among themselves by {spread:.1f} counts (std)."
                    if spread == spread
                    else "."
                )
            ),
            beside(
                "expected_traces",
                sizes,
                "The channels that change most, relative to their reading at the start of a run. Expected "
                "trace: the learned primitive, unrolled. Dissertation, IV.3 and IV.9.1.3 (ii).",
                "Three electrodes over time in every primitive: mean and std of the executions, and the "
                "learned expected trace.",
            ),
        ),
        results.simulated,
    )


def corrections(results: FeedbackResults, sizes: Sizes) -> Section:
    """Coupling targets and the checks on them."""
    checks = pd.concat([results.checks[name].assign(primitive=name) for name in results.adapted])
    grouped = checks.groupby(["primitive", "setting_deg"], sort=False)
    frame = grouped.agg(
        count=("demonstration", "count"),
        reproduction_deg=("reproduction_deg", "max"),
        smoothing_deg=("smoothing_deg", "mean"),
        others=("others", "mean"),
    ).reset_index()
    told = listing(
        f"{results.channel_name(channel)} in “{name}” (correlation {correlation:.2f})".replace(
            "-", "\N{MINUS SIGN}"
        )
        for name, (channel, correlation) in results.channels.items()
    )
    settings = listing(f"{setting:g}°" for setting in results.settings_deg)
    person = "a simulated person" if results.simulated else "a person"
    return Section(
        "Corrections",
        (
            Prose(
                f"At {settings} {person} corrects the roll of the tool while the robot executes the nominal "
                f"primitives and gives way about roll, {results.demonstrations_per_setting} times per "
                "setting. The coupling target is what has to be added to the nominal primitive to get the "
                "corrected movement (eq. IV.24); the sensor deviation is what the fingers feel less what "
                f"they should feel. The channel whose mean deviation follows the tilt most closely is {told}."
            ),
            beside(
                "coupling_targets",
                sizes,
                "Coupling targets and the deviation of that channel, mean ± std over the demonstrations of a "
                "setting. Dissertation, IV.6.2 and the black lines of figure IV.18.",
                "Coupling target and sensor deviation over time, one curve per setting, one column per "
                "primitive.",
            ),
            Prose(
                "Check: the nominal primitive, unrolled with the target about roll alone, must give the "
                f"demonstration back. It does within {frame['reproduction_deg'].max():.2f}° at every moment "
                "of every demonstration."
            ),
            Table(
                frame,
                "Checks per primitive and setting. Reproduction: largest distance of the unrolled primitive "
                "from the demonstration. Smoothing: what the low-pass before differentiation took away "
                "(rms). Other axes: target about pitch and yaw, which is not learned, relative to roll.",
                formats={"reproduction_deg": ".2f", "smoothing_deg": ".3f", "others": ".2f"},
                headings={
                    "setting_deg": "setting (°)",
                    "count": "demonstrations",
                    "reproduction_deg": "reproduction (°)",
                    "smoothing_deg": "smoothing (°)",
                    "others": "other axes",
                },
                source="tables/coupling_checks.csv",
                folded=True,
            ),
        ),
        results.simulated,
    )


def models(results: FeedbackResults, sizes: Sizes) -> Section:
    """Table IV.5 and figure IV.16."""
    dimensions = listing(
        f"{results.model_error(name, 'pca')['dimensions']:.3g} in primitive {results.number(name)}"
        + (
            f" (published: {PUBLISHED_DIMENSIONS[results.number(name)]})"
            if results.number(name) in PUBLISHED_DIMENSIONS
            else ""
        )
        for name in results.adapted
        if ("pca" in set(results.comparison["representation"]))
    )
    blocks: list[Block] = [
        Prose(
            "Leave one demonstration out (IV.9.3): each fold leaves out one demonstration of every setting; "
            "the samples of the others are shuffled into train, validation and test. NMSE: mean squared "
            "error relative to the variance of the target; 1 is as good as the mean. Only the generalisation "
            "part is a new demonstration: 10 ms away from every validation or test sample lies a training "
            "sample, so these two show how well a model interpolates, and a step "
            "chosen by validation comes late."
        ),
        Prose(
            "The headline is the model at the step that validation chose. The dissertation takes the step "
            "that is best for the demonstration left out; that is optimistic, since this demonstration then "
            "chooses and judges. Both are shown."
        ),
        Table(
            _table_iv_5(results),
            f"Table IV.5: NMSE of PMNN with 100 nodes, mean ± std over {counted(results.folds, 'fold')}.",
            headings={"generalization": "generalisation", "protocol": ""},
            strong=frozenset(
                place
                for place, protocol in enumerate(_table_iv_5(results)["protocol"])
                if protocol == STOPPING_NAMES["validation"]
            ),
            source="tables/model_errors.csv",
        ),
        Prose(_beside_published(results)),
        beside(
            "models",
            sizes,
            "As figure IV.16 top (network structures) and middle (features learned inside the network, or "
            "apart from it by PCA or an autoencoder), generalisation NMSE. The scales of the panels differ.",
            "Bars of the generalisation error of every representation, per primitive.",
        ),
        Prose(
            f"Principal components with 99 % of the variance: {dimensions} on average over the folds."
            if dimensions != "none"
            else "No representation was compressed."
        ),
        Prose(_orderings_in_words(results)),
        Table(
            _orderings(results),
            "Pairs as the dissertation orders them, models stopped by validation. Difference: NMSE of the "
            "second minus that of the first, mean over folds with its 95 % confidence interval (t) and the "
            "two-sided Wilcoxon signed-rank test. Folds share most of their training samples, so intervals "
            "are somewhat too narrow and p-values too small.",
            formats={"difference": ".3f", "p_value": ".2g"},
            headings={
                "better": "first",
                "worse": "second",
                "interval": "95 % CI",
                "p_value": "p",
                "verdict": "first is",
            },
            source="tables/model_orderings.csv",
        ),
    ]
    return Section("Feedback models compared", (*blocks, *_weights(results, sizes)), results.simulated)


def _table_iv_5(results: FeedbackResults) -> pd.DataFrame:
    rows = []
    for name in results.adapted:
        number = results.number(name)
        label = f"{number}. {name}"
        if number in PUBLISHED_NMSE:
            cells = {part: f"{mean:.2f} ± {std:.2f}" for part, (mean, std) in PUBLISHED_NMSE[number].items()}
            rows.append({"primitive": label, "protocol": "published"} | cells)
        for stopping, words in STOPPING_NAMES.items():
            error = results.model_error(name, "pmnn_100", stopping)
            cells = {part: f"{error[f'{part}_mean']:.3f} ± {error[f'{part}_std']:.3f}" for part in PARTS}
            rows.append({"primitive": label, "protocol": words} | cells)
    return pd.DataFrame(rows)


def _beside_published(results: FeedbackResults) -> str:
    """Whether the errors are below the published ones, and what that means."""
    parts = []
    for name in results.adapted:
        number = results.number(name)
        if number in PUBLISHED_NMSE:
            ours = results.model_error(name, "pmnn_100")["generalization_mean"]
            theirs = PUBLISHED_NMSE[number]["generalization"][0]
            relation = "below" if ours < theirs else "above"
            parts.append(f"{ours:.2f} in primitive {number} ({relation} the published {theirs:.2f})")
    text = f"Generalisation NMSE at the step chosen by validation: {listing(parts)}."
    if results.simulated:
        text += (
            " Published and simulated numbers come from different data. A simulated person and simulated "
            "fingers may repeat themselves better than real ones, so the orderings below say more than the "
            "levels."
        )
    return text


def _orderings_in_words(results: FeedbackResults) -> str:
    """How many of the pairs hold per primitive, which do not, and how the optimistic protocol differs."""
    parts = []
    for name in results.adapted:
        rows = results.orderings[results.orderings["primitive"] == name]
        honest = rows[rows["stopping"] == "validation"]
        text = f"in “{name}” {(honest['verdict'] == BETTER).sum()} of {len(honest)} pairs are as published"
        for found, words in ((WORSE, "the other way round"), ("undecided", "undecided")):
            pairs = [
                f"{plain_name(row.better)} and {plain_name(row.worse)}"
                for row in honest.itertuples()
                if row.verdict == found
            ]
            text += f", {len(pairs)} {words} ({'; '.join(pairs)})" if pairs else ""
        parts.append(text)
    both = results.orderings.pivot_table(
        index=["primitive", "better", "worse"], columns="stopping", values="verdict", aggfunc="first"
    )
    changed = int((both["validation"] != both["generalization"]).sum())
    return (
        f"{capitalised('; '.join(parts))}. The optimistic protocol changes "
        f"{counted(changed, 'verdict') if changed else 'no verdict'}. "
        "PMNN with 6 nodes loses half of its nodes to dropout in every training step, so its errors on "
        "training data are high whatever its features."
    )


def _orderings(results: FeedbackResults) -> pd.DataFrame:
    rows = results.orderings[results.orderings["stopping"] == "validation"]
    number = {name: results.number(name) for name in results.adapted}
    rows = rows.sort_values("primitive", key=lambda column: column.map(number), kind="stable")
    bounds = zip(
        rows["difference"] - rows["half_width"], rows["difference"] + rows["half_width"], strict=True
    )
    return pd.DataFrame(
        {
            "primitive": [f"{number[name]}. {name}" for name in rows["primitive"]],
            "better": rows["better"].map(plain_name).to_list(),
            "worse": rows["worse"].map(plain_name).to_list(),
            "difference": rows["difference"].to_list(),
            "interval": [interval(low, high, ".3f") for low, high in bounds],
            "p_value": rows["p_value"].to_list(),
            "verdict": rows["verdict"].to_list(),
        }
    )


def _weights(results: FeedbackResults, sizes: Sizes) -> list[Block]:
    name = results.adapted[0]
    dominant = dominant_features(results.networks[name])
    kernels, nodes = dominant.shape
    own = int(dominant.sum(axis=1).max())
    near, far = shared_features(dominant)
    return [
        beside(
            "weights",
            sizes,
            f"As figure IV.16 bottom: for each of the {kernels} phase kernels of the model of “{name}” the "
            f"{own} of {nodes} nodes with the largest weights (yellow).",
            "Matrix of phase kernels by hidden nodes; the dominant ones are marked.",
        ),
        Prose(
            f"Neighbouring kernels have {near:.1f} of their {own} dominant nodes in common, any two kernels "
            f"{far:.1f}; by chance it would be {own * own / nodes:.1f}. So "
            + (
                "the nodes that matter change with the phase, as the dissertation says."
                if far < 0.5 * own
                else "the nodes that matter are largely the same at every phase, unlike in the dissertation."
            )
        ),
    ]
