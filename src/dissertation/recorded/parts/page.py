"""Page of logs with known parts of the torque."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from dissertation.recorded.parts.parameters import AUTHORS, RANDOM, PartsParameters
from structlearn.readers.joint_log import PartedLog, read_log_table
from structlearn.reporting.document import Table
from structlearn.reporting.evidence import Evidence
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import rounded
from structlearn.tasks.motion.motion_results import stated
from structlearn.tasks.section import Section
from structlearn.tasks.task_files import TaskFiles

PROTOCOLS = {AUTHORS: "their protocol", RANDOM: "random choices"}
MODELS = {"mlp": "MLP", "delan": "DeLaN", "cov": "planar arm, Cov"}


def sections(files: TaskFiles) -> list[Section]:
    """The section on the parts of the torque."""
    first, *_ = read_log_table(files.recorded / "logs.parquet", PartedLog)
    return [parts_section(files.tables("parts"), files.entry(PartsParameters), first.provenance)]


def parts_section(
    tables: Mapping[str, pd.DataFrame], parameters: PartsParameters, origin: Mapping[str, str]
) -> Section:
    """Section for logs with known parts of the torque: findings are errors relative to the published ones."""
    find, published = Findings("trainings"), parameters.published
    rows: dict[str, dict[str, Any]] = {
        name: {"part": name, "published": f"{value:.2g}"} for name, value in published.items()
    }
    for (model, protocol), its in tables["parts"].groupby(["model", "protocol"], sort=False):
        ratios = {part: one.to_numpy() / published[part] for part, one in its.groupby("measure")["error"]}
        ratios = {part: ratios[part] for part in published}
        name, single = f"{model}_{protocol}", len(ratios["torque"]) == 1
        exact = {part: one.item() for part, one in ratios.items()} if single else {}
        found = find.exact(name, exact) if single else find.mean(name, ratios)
        assert not isinstance(found, Evidence), "there is a row per part"
        for part, one in found.items():
            scale = published[part]
            its = replace(one, value=scale * one.value, low=scale * one.low, high=scale * one.high)
            text = stated(its, ".1e") if its.low < its.high else rounded(its.value, ".1e")
            rows[part][f"{MODELS[model]}, {PROTOCOLS[protocol]}"] = text
    planar, fits = tables["planar"], find.among("fits")
    lengths = planar["length_m"]
    fits.exact_count("possible_links", int(planar["possible"].sum()), len(planar))
    fits.exact("length_m", lengths.median(), len(planar), unit="m")
    fits.exact("length_spread_m", np.ptp(lengths), len(planar), unit="m")
    return Section(
        "parts",
        "Parts of the torque",
        "torque_parts.html.jinja",
        lead="torque_parts_lead.html.jinja",
        facts={"chosen": parameters, "origin": origin},
        find=find,
        tables={"torque_parts": Table(pd.DataFrame(rows.values()))},
    )
