"""The page of the ablations: refinement with one parameter changed at a time, from experiments of DVC."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from structlearn.ground.artefacts import Metrics
from structlearn.policy_search.rollouts import FEEDBACK
from structlearn.reporting.page import MISSING, Link, Page, Prose, Section, Table
from structlearn.reporting.prose import counted
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


@dataclass(frozen=True)
class Protocol:
    """What all experiments share.

    Attributes:
        refined_deg: setting that is refined on.
        seen_deg: settings that the models before are learned from.
    """

    refined_deg: float
    seen_deg: Sequence[float]


def outcomes(experiments: Sequence[Experiment], protocol: Protocol) -> pd.DataFrame:
    """One row per experiment.

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
                means[AFTER, protocol.refined_deg, name] / means[BEFORE, protocol.refined_deg, name]
            )
        sums = means.groupby(level=["model", "setting_deg"]).sum()
        row["seen_ratio"] = max(sums[AFTER, deg] / sums[BEFORE, deg] for deg in protocol.seen_deg)
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


def tables(table: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Tables by name."""
    return {"refinement": summary(table), "refinement_seeds": table}


def ablation_page(table: pd.DataFrame, protocol: Protocol, variants: Sequence[Variant]) -> Page:
    """The page; the tables are expected as `tables/refinement.csv` and `tables/refinement_seeds.csv`.

    Args:
        table: of `outcomes`.
        protocol: what all experiments share.
        variants: that the rows are of.
    """
    names = [column.removesuffix("_iterations") for column in table if column.endswith("_iterations")]
    shown = _described(table, names, {one.name: one for one in variants})
    headings = {"variant": "", "option": "-S"} | {
        f"{name}_{what}": f"{name}: {words}"
        for name in names
        for what, words in (("iterations", "iter."), ("ratio", "cost"))
    }
    headings["seen_ratio"] = "seen: cost"
    counts = ["rollouts", "failed", *(f"{name}_iterations" for name in names)]
    return Page(
        title="Ablations: refinement of the feedback models by trial",
        lead=(
            "One parameter of the refinement is changed at a time. Every row is an experiment of DVC, "
            "run by `make ablations`."
        ),
        sections=(
            Section(
                "PI2 refinement",
                (
                    Prose(
                        f"The models are refined on a board of {protocol.refined_deg:g}° and executed on all "
                        f"settings. Cost: mean accumulated cost at {protocol.refined_deg:g}° after "
                        "refinement over that before, of executions that are not part of it. Seen: the "
                        "largest such ratio over the settings that the models were learned from, both "
                        f"primitives summed. {_spread(table)}"
                    ),
                    Table(
                        shown,
                        "Refinement with one parameter changed. Rollouts: all executions of the refinement, "
                        "those that only judge the network included.",
                        formats=dict.fromkeys(counts, "g"),
                        headings=headings,
                        source="tables/refinement.csv",
                    ),
                    Table(
                        table,
                        "The single experiments.",
                        formats={column: ".3f" for column in table if column.endswith("_ratio")},
                        source="tables/refinement_seeds.csv",
                        folded=True,
                    ),
                ),
                simulated=True,
            ),
        ),
        simulated=True,
        back=Link("../scraping/index.html", "Scraping"),
    )


def _spread(table: pd.DataFrame) -> str:
    seeds = int(table["seed"].nunique())
    if seeds == 1:
        return "One seed of the exploration: small differences between variants mean nothing."
    return (
        f"Means over {counted(seeds, 'seed')} of the exploration, in brackets the lowest and the highest: "
        "what seeds differ by is the yardstick for what variants differ by."
    )


def _described(table: pd.DataFrame, names: Sequence[str], variants: Mapping[str, Variant]) -> pd.DataFrame:
    """The summary in words, with the range over the seeds."""
    shown = summary(table)
    for name in (*names, "seen"):
        column = f"{name}_ratio"
        grouped = table.groupby("variant", sort=False)[column]
        shown[column] = [
            f"{mean:.2f}" + (f" ({least:.2f} to {most:.2f})" if least < most else "")
            for mean, least, most in zip(shown[column], grouped.min(), grouped.max(), strict=True)
        ]
    shown.insert(1, "option", [variants[name].option or MISSING for name in shown["variant"]])
    return shown.assign(variant=[variants[name].words for name in shown["variant"]]).drop(columns="executed")
