"""The page of the ablations: refinement with one parameter changed at a time, from experiments of DVC."""

from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from structlearn.ground.artefacts import Metrics
from structlearn.policy_search.rollouts import FEEDBACK
from structlearn.reporting.document import MISSING, Document, Table
from structlearn.testbeds.scraping.protocol.board_refinement import BoardRefinementParameters
from structlearn.testbeds.scraping.protocol.executed_sets import AFTER, BEFORE


@dataclass(frozen=True)
class Variant:
    """A change of one parameter.

    Attributes:
        name: part of the experiments' names.
        words: what is changed.
        option: of `dvc exp run -S`; empty where nothing is changed.
    """

    name: str
    words: str
    option: str = ""


@dataclass(frozen=True)
class Experiment:
    """One run of the refinement and its evaluation.

    Attributes:
        variant: its name.
        seed: of the exploration.
        history: of the stage `refine`.
        scores: of the stage `evaluate_refinement`.
    """

    variant: str
    seed: int
    history: pd.DataFrame
    scores: pd.DataFrame


def outcomes(experiments: Sequence[Experiment], parameters: BoardRefinementParameters) -> pd.DataFrame:
    """One row per experiment; all share the settings learned from and refined on.

    Returns:
        `variant`, `seed`; `rollouts` of the whole refinement, and `executed`, those of policies alone;
        `failed`; per primitive `<name>_iterations` and `<name>_ratio`, the mean cost in the refined setting
        after over before; `seen_ratio`, the largest such ratio over the settings learned from, all primitives
        summed.
    """
    rows = []
    for one in experiments:
        means = one.scores.groupby(["model", "setting_deg", "primitive"])["cost_rad"].mean()
        row: dict[str, object] = {"variant": one.variant, "seed": one.seed, "rollouts": len(one.history)}
        row["executed"] = int((one.history["kind"] != FEEDBACK).sum())
        row["failed"] = int((one.history["fault"] != "").sum())
        for name in one.scores["primitive"].unique():
            own = one.history[one.history["primitive"] == name]
            row[f"{name}_iterations"] = int(own["iteration"].max()) if len(own) else 0
            row[f"{name}_ratio"] = (
                means[AFTER, parameters.setting_deg, name] / means[BEFORE, parameters.setting_deg, name]
            )
        sums = means.groupby(level=["model", "setting_deg"]).sum()
        row["seen_ratio"] = max(sums[AFTER, deg] / sums[BEFORE, deg] for deg in parameters.settings_deg)
        rows.append(row)
    return pd.DataFrame(rows)


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Means of `outcomes` over the seeds, one row per variant, in the order of their first rows."""
    return table.drop(columns="seed").groupby("variant", sort=False).mean().reset_index()


def metrics(table: pd.DataFrame) -> Metrics:
    """`<quantity>_ratio_<variant>`, means over the seeds."""
    values: Metrics = {"simulated": True}
    for row in summary(table).to_dict("records"):
        ratios = {key: value for key, value in row.items() if key.endswith("_ratio")}
        values |= {f"{key}_{row['variant']}": float(value) for key, value in ratios.items()}
    return values


def tables(table: pd.DataFrame, variants: Sequence[Variant]) -> dict[str, Table]:
    """The summary, the single experiments, and the summary in words with the range over the seeds."""
    named = {one.name: one for one in variants}
    words = summary(table).drop(columns=["variant", "executed"])
    words.insert(0, "-S", [named[name].option or MISSING for name in summary(table)["variant"]])
    words.insert(0, "changed", [named[name].words for name in summary(table)["variant"]])
    grouped = table.groupby("variant", sort=False)
    for name in (column for column in words if column.endswith("_ratio")):
        ends = zip(words[name], grouped[name].min(), grouped[name].max(), strict=True)
        words[name] = [
            f"{mean:.2f}" + (f" ({low:.2f} to {high:.2f})" if low < high else "") for mean, low, high in ends
        ]
    headings = {name: name.replace("_ratio", ": cost").replace("_", " ") for name in table}
    return {
        "refinement": Table(summary(table)),
        "refinement_seeds": Table(table, dict.fromkeys(table.filter(like="_ratio"), ".3f"), headings),
        "refinement_in_words": Table(words, dict.fromkeys(words, "g"), headings),
    }


def ablation_page(
    table: pd.DataFrame, parameters: BoardRefinementParameters, variants: Sequence[Variant]
) -> tuple[Document, dict[str, Table]]:
    """The page and all its tables, of the rows of `outcomes`."""
    made = tables(table, variants)
    facts = {"refined_deg": parameters.setting_deg, "seeds": int(table["seed"].nunique())}
    package = "structlearn.testbeds.scraping.page"
    page = Document("ablations.html.jinja", package, "evaluate_refinement", facts, made, simulated=True)
    return page, made
