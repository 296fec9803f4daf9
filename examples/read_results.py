"""Results in pandas: key figures and verdicts of all testbeds, and a table of a task's own.

python examples/read_results.py              # from the project's root
"""

from pathlib import Path

import pandas as pd

from structlearn.core.artefacts import read_metrics, read_table
from structlearn.core.errors import InputError
from structlearn.core.stage import run

REPORTS, TASKS = Path("reports"), Path("data/tasks")


def key_figures() -> pd.DataFrame:
    """All numbers of all `metrics.json`: columns report, name, value."""
    found = {path.parent.relative_to(REPORTS): read_metrics(path) for path in REPORTS.rglob("metrics.json")}
    rows = [
        (str(report), name, value) for report, its in sorted(found.items()) for name, value in its.items()
    ]
    return pd.DataFrame(rows, columns=["report", "name", "value"])


def verdicts() -> pd.DataFrame:
    """How often each verdict was found, a row per testbed."""
    files = sorted(REPORTS.glob("*/tables/claims.csv"))
    claims = pd.concat([pd.read_csv(file).assign(testbed=file.parts[-3]) for file in files])
    return pd.crosstab(claims["testbed"], claims["verdict"])


def peak_speeds(task: Path) -> pd.Series:
    """Largest speed of each primitive of a task in its nominal run, m/s."""
    path = read_table(task / "primitives/nominal.parquet")
    speed = (path[["vx", "vy", "vz"]] ** 2).sum(axis=1) ** 0.5
    return speed.groupby(path["primitive"], sort=False).max().rename("peak_m_s")


def main() -> None:
    """Print them. Raises InputError: not called from the project's root."""
    if not REPORTS.is_dir():
        raise InputError(f"{REPORTS}: no such folder; go to the project's root first")
    print(key_figures().to_string(index=False), verdicts().to_string(), sep="\n\n")
    for task in sorted(path for path in TASKS.glob("*") if (path / "primitives/nominal.parquet").exists()):
        print(f"\n{task.name}", peak_speeds(task).to_string(), sep="\n")


if __name__ == "__main__":
    run(main, stage=False)
