"""The page of times: how long every stage took when it last ran, by testbed.

    python -m structlearn.reporting.stage_times

It is no artefact of a stage, since times differ from run to run; `make repro` and `make recorded` render it.
"""

import os
import platform
from collections.abc import Iterable, Mapping
from dataclasses import astuple, fields
from pathlib import Path

import pandas as pd

from structlearn.ground.artefacts import publish
from structlearn.ground.params import read_values
from structlearn.ground.wall_clock import TIMES, StageTime, read_times
from structlearn.reporting.document import Document, Table, render
from structlearn.reporting.prose import counted

PIPELINES = ("dvc.yaml", "stages/recorded/dvc.yaml")

OVERVIEW = "overview"
"""Group of stages that belong to no testbed; their scripts lie beside the testbeds' folders."""


HEADINGS = {
    "wall_s": "wall time (s)",
    "cpu_s": "CPU time (s)",
    "busy": "cores busy",
    "serial": "serial share",
    "cores_4_s": "4 cores (s)",
    "cores_16_s": "16 cores (s)",
    "cores_64_s": "64 cores (s)",
}


def stage_times(pipelines: Iterable[Mapping], times: Mapping[str, StageTime]) -> pd.DataFrame:
    """One row per stage, in the order of the pipelines.

    Args:
        pipelines: contents of `dvc.yaml` files.
        times: by command without `python`.

    Returns:
        `testbed`, the folder of the stage's script; `stage`; the fields of `StageTime`, NaN where it has no
        time.
    """
    rows, columns = [], [field.name for field in fields(StageTime)]
    for pipeline in pipelines:
        for name, stage in pipeline["stages"].items():
            command = stage["cmd"].removeprefix("python ")
            folder = Path(command.split()[0]).parent.name
            taken = astuple(times[command]) if command in times else [float("nan")] * len(columns)
            rows.append((OVERVIEW if folder == "stages" else folder, name, *taken))
    return pd.DataFrame(rows, columns=["testbed", "stage", *columns])


def times_page(table: pd.DataFrame, machine: str) -> str:
    """The page as HTML.

    Args:
        table: of `stage_times`.
        machine: its cores, processor and Python in words.
    """
    shown = _with_sums(table)
    times = Table(
        shown[["testbed", "stage", *HEADINGS]],
        formats={column: ".0%" if column == "serial" else ".1f" for column in HEADINGS},
        headings=HEADINGS,
        strong=frozenset(shown.index[shown["sum"]]),
    )
    facts = {
        "machine": machine,
        "stages": len(table),
        "missing": int(table["wall_s"].isna().sum()),
        "wall_min": table["wall_s"].sum() / 60.0,
        "cpu_min": table["cpu_s"].sum() / 60.0,
        "serial_share": shown["serial"].iloc[-1],
        "most_cores_min": table["cores_64_s"].sum() / 60.0,
        "file": TIMES.name,
        "times": times,
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


def _with_sums(table: pd.DataFrame) -> pd.DataFrame:
    """The table with sums below each testbed and below all, the cores that were busy, the serial share."""
    parts = []
    for testbed, group in table.groupby("testbed", sort=False):
        parts += [group.assign(sum=False), _sum(group, testbed)]
    shown = pd.concat([*parts, _sum(table, "all")], ignore_index=True)
    one_core_s = shown["serial_s"] + shown["shared_s"]
    return shown.assign(
        busy=shown["cpu_s"] / shown["wall_s"].where(shown["wall_s"] > 0.0),
        serial=shown["serial_s"] / one_core_s.where(one_core_s > 0.0),
    )


def _sum(table: pd.DataFrame, name: str) -> pd.DataFrame:
    """A row with the sums of the times that are known."""
    sums = table.drop(columns=["testbed", "stage"]).sum(min_count=1)
    row = {"testbed": name, "stage": counted(len(table), "stage"), **sums, "sum": True}
    return pd.DataFrame([row])


def main() -> None:
    """Render the page of this project's pipelines."""
    pipelines = [read_values(name) for name in PIPELINES]
    page = times_page(stage_times(pipelines, read_times()), this_machine())
    with publish(TIMES.with_name("index.html")) as path:
        path.write_text(page, encoding="utf-8")
    print(f"{TIMES.with_name('index.html')} is up to date")


if __name__ == "__main__":
    main()
