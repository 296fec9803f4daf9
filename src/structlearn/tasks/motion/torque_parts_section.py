"""Models of a simulated planar arm on its task's page: every part of the torque beside what is published."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.palette import BLACK, BLUE, ORANGE, PINK, Look
from structlearn.reporting.claims import Evidence
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import legend, panel, styled
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import interval, rounded
from structlearn.tasks.motion.motion_parameters import AUTHORS, RANDOM, PartsParameters
from structlearn.tasks.section import Section

LOOKS = {"mlp": Look("MLP", ORANGE), "delan": Look("DeLaN", PINK), "cov": Look("planar arm, Cov", BLUE)}
PROTOCOLS = {AUTHORS: "their protocol", RANDOM: "random choices"}


def parts_section(
    tables: Mapping[str, pd.DataFrame], parameters: PartsParameters, origin: Mapping[str, str]
) -> Section:
    """Of a task whose logs have the parts of their torques: findings are errors over those published."""
    find, published = Findings("trainings"), parameters.published
    rows: dict[str, dict[str, Any]] = {
        name: {"part": name, "published": f"{value:.2g}"} for name, value in published.items()
    }
    for (model, protocol), its in tables["parts"].groupby(["model", "protocol"], sort=False):
        errors = {name: one.to_numpy() for name, one in its.groupby("measure")["error"]}
        ratios = {name: errors[name] / value for name, value in published.items()}
        name, make = f"{model}_{protocol}", find.exact if len(errors["torque"]) == 1 else find.mean
        found = make(
            name, {part: its.item() for part, its in ratios.items()} if make == find.exact else ratios
        )
        assert not isinstance(found, Evidence), "there is a row per part"
        for part, one in found.items():
            texts = [rounded(published[part] * one.value, ".1e")]
            if one.low < one.high:
                texts.append(interval(published[part] * one.low, published[part] * one.high, ".1e"))
            rows[part][f"{LOOKS[model].name}, {PROTOCOLS[protocol]}"] = " ".join(texts)
    power = tables["parts"].query("model == 'delan' and protocol == @RANDOM and measure == 'power'")
    worst = power.loc[power["error"].idxmax()]
    find.among("random choices").exact("worst_power", worst["error"] / published["power"], len(power))
    planar = tables["planar"]
    lengths = planar["length_m"]
    find.among("fits").counted("possible_links", int(planar["possible"].sum()), len(planar))
    find.among("fits").exact("length_m", lengths.median(), len(planar), unit="m")
    find.among("fits").exact("length_spread_m", np.ptp(lengths), len(planar), unit="m")
    return Section(
        "parts",
        "Parts of the torque",
        "torque_parts.html.jinja",
        lead="torque_parts_lead.html.jinja",
        facts={"chosen": parameters, "origin": origin, "worst": worst["left_out"].split()},
        find=find,
        tables={"torque_parts": Table(pd.DataFrame(rows.values()))},
        pictures={"torque_parts": parts_panel(tables["parts"], published)},
    )


@styled
def parts_panel(parts: pd.DataFrame, published: Mapping[str, float]) -> Figure:
    """Errors of all trainings by part, beside those published."""
    labels = {"ylabel": "squared error", "yscale": "log"}
    figure, axes = panel("Characters not learned from", 3.5, **labels)
    places = np.arange(len(published))
    for shift, (model, look) in zip((-0.2, 0.0, 0.2), LOOKS.items(), strict=True):
        its = parts[parts["model"] == model]
        where = its["measure"].map(dict(zip(published, places, strict=True))) + shift
        axes.plot(where, its["error"], "o", color=look.colour, markersize=3.5, alpha=0.6, label=look.name)
    axes.hlines(list(published.values()), places - 0.4, places + 0.4, color=BLACK, label="DeLaN, published")
    axes.set_xticks(places, list(published))
    return legend(figure)
