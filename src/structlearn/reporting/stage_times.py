"""The page of times: how long every stage took when it last ran.

    python -m structlearn.reporting.stage_times

It is no artefact of a stage, since times differ from run to run; `make repro` and `make recorded` render it.
"""

import os
import platform
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from structlearn.ground.artefacts import publish
from structlearn.ground.params import read_values
from structlearn.ground.wall_clock import TIMES, StageTime, read_times
from structlearn.reporting.document import Document, Table, render
from structlearn.reporting.prose import counted

PIPELINES = ("dvc.yaml", "stages/recorded/dvc.yaml")

HEADINGS = {"wall_s": "wall time (s)", "cpu_s": "CPU time (s)"}


def stage_times(pipelines: Mapping[str, Mapping], times: Mapping[str, StageTime]) -> pd.DataFrame:
    """`pipeline`, `stage`, `wall_s`, `cpu_s` of every stage in order, NaN where it has no time.

    Args:
        pipelines: contents of `dvc.yaml` files by path.
        times: by command without `python`.
    """
    unknown = StageTime(float("nan"), float("nan"))
    rows = [
        (path, name, *times.get(stage["cmd"].removeprefix("python "), unknown))
        for path, pipeline in pipelines.items()
        for name, stage in pipeline["stages"].items()
    ]
    return pd.DataFrame(rows, columns=["pipeline", "stage", *StageTime._fields])


def times_page(table: pd.DataFrame, machine: str) -> str:
    """The page as HTML.

    Args:
        table: of `stage_times`.
        machine: its cores, processor and Python in words.
    """
    parts = []
    for path, group in table.groupby("pipeline", sort=False):
        total = group[list(HEADINGS)].sum(min_count=1)
        parts += [group, pd.DataFrame([{"pipeline": path, "stage": counted(len(group), "stage"), **total}])]
    shown = pd.concat(parts, keys=range(len(parts)))
    totals = [place for place, (part, _) in enumerate(shown.index) if part % 2]
    facts = {
        "machine": machine,
        "stages": len(table),
        "missing": int(table["wall_s"].isna().sum()),
        "wall_min": table["wall_s"].sum() / 60.0,
        "cpu_min": table["cpu_s"].sum() / 60.0,
        "file": TIMES.name,
        "times": Table(shown, dict.fromkeys(HEADINGS, ".1f"), HEADINGS, frozenset(totals)),
    }
    return render(Document("times.html.jinja", "structlearn.reporting", facts=facts), figures={})


def this_machine() -> str:
    """Cores, processor and Python of this machine in words."""
    return (
        f"a machine with {counted(os.cpu_count() or 1, 'core')} ({_processor()}), "
        f"Python {platform.python_version()}"
    )


def _processor() -> str:
    """Its model; `platform` knows no more than its architecture under Linux."""
    information = Path("/proc/cpuinfo")
    lines = information.read_text().splitlines() if information.exists() else []
    models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()


def main() -> None:
    """Render the page of this project's pipelines."""
    pipelines = {path: read_values(path) for path in PIPELINES}
    page = times_page(stage_times(pipelines, read_times()), this_machine())
    with publish(TIMES.with_name("index.html")) as path:
        path.write_text(page, encoding="utf-8")
    print(f"{TIMES.with_name('index.html')} is up to date")


if __name__ == "__main__":
    main()
