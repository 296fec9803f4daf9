"""Contents of the page of simulated beside recorded touch: its tables, metrics, claims and document."""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from structlearn.core.artefacts import Metrics
from structlearn.reporting.claims import Found, exact, judge, read_claims, unknown
from structlearn.reporting.document import Document, Table, environment
from structlearn.reporting.prose import listing, rounded
from structlearn.tasks.public import public_names
from structlearn.tasks.public.page.assembly import PACKAGE, source
from structlearn.tasks.public.page.recorded_tables import shown
from structlearn.tasks.public.protocol.touch_calibration import (
    REFERENCE,
    SIMULATED,
    CalibrationParameters,
)

STAGE = "stages/recorded/dvc.yaml:calibration_report"

STATISTICS = {
    "contact_strongest": "contact, strongest electrode (counts)",
    "contact_second": "contact, second strongest (counts)",
    "contact_fourth": "contact, fourth strongest (counts)",
    "contact_median": "contact, median electrode (counts)",
    "contact_many": "contact, electrodes beyond 100 counts",
    "range_strongest": "range, strongest electrode (counts)",
    "range_second": "range, second strongest (counts)",
    "range_fourth": "range, fourth strongest (counts)",
    "range_median": "range, median electrode (counts)",
    "noise_median": "noise, median electrode (counts)",
    "noise_largest": "noise, noisiest electrode (counts)",
    "active": "active electrodes",
    "pca_dimensions": "principal components",
    "power_slow": "0.4 to 2 Hz, strongest electrode (counts)",
    "power_middle": "2 to 10 Hz, strongest electrode (counts)",
    "power_fast": "10 to 50 Hz, strongest electrode (counts)",
}
"""What the statistics of `touch_calibration.comparison` are called."""

CLAIMS = {
    "contact": "contact",
    "range": "range",
    "noise": "noise",
    "active": "active",
    "dimensions": "pca",
    "spectrum": "power",
}
"""Claims, and with what the names of their statistics begin."""

HEADLINES = (
    "agree",
    "compared",
    "contact_strongest_recorded",
    "contact_strongest_simulated",
    "noise_median_recorded",
    "noise_median_simulated",
    "pca_dimensions_recorded",
    "pca_dimensions_simulated",
)


def evidence(comparison: pd.DataFrame) -> dict[str, Found]:
    """Ratios of medians, simulated over recorded, by claim and statistic."""
    ratios = comparison.set_index("statistic")["ratio"]
    return {
        claim: {_case(name): exact(ratio, 1) for name, ratio in ratios.items() if name.startswith(beginning)}
        for claim, beginning in CLAIMS.items()
    }


def _case(name: str) -> str:
    """`strongest electrode`, or the band of a spectrum."""
    words = STATISTICS[name].removesuffix(" (counts)").split(", ")
    return words[0] if name.startswith("power") else words[-1]


def metrics(comparison: pd.DataFrame) -> Metrics:
    """The flat metrics of the comparison."""
    values: Metrics = {}
    for row in comparison.itertuples():
        values |= {f"{row.statistic}_recorded": row.recorded, f"{row.statistic}_simulated": row.simulated}
    return values | {"agree": int(comparison["agrees"].sum()), "compared": len(comparison)}


def tables(stored: Mapping[str, pd.DataFrame]) -> dict[str, Table]:
    """By name: the comparison, and medians of all sets."""
    fingers = stored["fingers"]
    statistics = [name for name in STATISTICS if name in fingers]
    medians = fingers.groupby("group")[statistics].median().T
    medians = medians[[group for group in public_names.TOUCH_WORLDS if group in medians]]
    medians.insert(0, "statistic", [STATISTICS[name] for name in statistics])
    comparison = stored["comparison"].assign(statistic=stored["comparison"]["statistic"].map(STATISTICS))
    return {
        "statistics": shown(comparison, ratio=".2f"),
        "medians": shown(medians, **dict.fromkeys(public_names.TOUCH_WORLDS, ".4g")),
    }


def strongest(electrodes: pd.DataFrame, group: str) -> str:
    """`16 (left, +100) and 1 (right, +300)`: what contact moves most of every finger, two each, first run."""
    its = electrodes[electrodes["group"] == group]
    its = its[its["run"] == its["run"].iloc[0]]
    order = its["contact"].abs().sort_values(ascending=False, kind="stable").index
    rows = its.loc[order].groupby("finger", sort=True).head(2)
    return listing(
        f"{row.electrode} ({row.finger}, {rounded(row.contact, '+.0f')})" for row in rows.itertuples()
    )


def calibration_document(
    stored: Mapping[str, pd.DataFrame],
    shown_tables: Mapping[str, Table],
    parameters: Mapping[str, CalibrationParameters],
) -> Document:
    """The page, which says so where nothing was recorded; parameters by their key in `params.yaml`."""
    claims = read_claims(Path(__file__).with_name("calibration_claims.yaml"))
    constants = {
        "factor": parameters["calibrate"].factor,
        "active_counts": parameters["calibrate"].active_counts,
        "variance_percent": 100 * parameters["calibrate"].variance,
    }
    if not stored:
        nothing = {claim.evidence: unknown("no scraping execution is recorded here") for claim in claims}
        judged = judge(claims, nothing, environment(PACKAGE), constants)
        return Document("not_recorded.html.jinja", PACKAGE, STAGE, judged=judged)
    comparison, electrodes = stored["comparison"], stored["electrodes"]
    facts = (
        constants
        | metrics(comparison)
        | {
            "compared_rows": comparison.set_index("statistic").to_dict("index"),
            "runs": stored["fingers"].query("group == @SIMULATED")["run"].nunique(),
            "strongest_recorded": strongest(electrodes, REFERENCE),
            "strongest_simulated": strongest(electrodes, SIMULATED),
        }
    )
    return Document(
        template="calibration.html.jinja",
        package=PACKAGE,
        stage=STAGE,
        facts=facts,
        tables=shown_tables,
        judged=judge(claims, evidence(comparison), environment(PACKAGE), facts),
        sources={name: source("calibration/" + name, "calibrate") for name in stored},
        parameters=parameters,
        simulated=True,
    )
