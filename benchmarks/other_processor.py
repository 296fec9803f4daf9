"""Run the whole pipeline as on another processor, and hold its verdicts against those of `reports/`.

    python benchmarks/other_processor.py

The three libraries that choose kernels by the processor (OpenBLAS, PyTorch, Numba) are told that it is an
older one. The run is in a clone with an empty cache; it takes longer than `dvc repro`. Writes
`reports/other_processor` and names every verdict that changed; ends with code 1 if one is another, not only
undecided. What pages quote from studies is not made again, and is counted as such.
"""

import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path

import pandas as pd

from dissertation.evidence.verdicts import (
    FLIPPED,
    OUTCOMES,
    changes,
    compared,
    other_processor_page,
)
from structlearn.core import processor
from structlearn.core.artefacts import publish, write_csv
from structlearn.reporting.prose import counted

SETTINGS = {"OPENBLAS_CORETYPE": "Nehalem", "ATEN_CPU_CAPABILITY": "default", "NUMBA_CPU_NAME": "generic"}
TESTBEDS = ("scraping", "obstacles", "dynamics", "servoing")
RESULT = Path("reports/other_processor")


def main() -> None:
    """Run, compare, report."""
    with tempfile.TemporaryDirectory() as folder:
        clone = Path(folder, "project")
        subprocess.run(["git", "clone", "--quiet", ".", clone], check=True)
        others = {name: value for name, value in os.environ.items() if name not in processor.PINS}
        own = {processor.BITS: processor.NATIVE, "PYTHONPATH": str(clone / "src")}
        environment = others | SETTINGS | own
        subprocess.run(["dvc", "repro"], cwd=clone, env=environment, check=True)
        table = compared(claims(Path("reports")), claims(clone / "reports"))
    write_csv(table, RESULT / "claims.csv")
    with publish(RESULT / "index.html") as path:
        path.write_text(other_processor_page(table, SETTINGS, this_machine()), encoding="utf-8")
    print(*changes(table), sep="\n")
    print(", ".join(f"{(table['outcome'] == outcome).sum()} {outcome}" for outcome in OUTCOMES))
    if (table["outcome"] == FLIPPED).any():
        sys.exit(f"error: {RESULT}/claims.csv: a verdict depends on the processor")


def this_machine() -> str:
    """Cores, processor and Python of this machine in words."""
    information = Path("/proc/cpuinfo")  # `platform` knows no more than the architecture under Linux
    lines = information.read_text().splitlines() if information.exists() else []
    models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    model = models[0] if models else platform.processor() or platform.machine()
    cores = counted(os.cpu_count() or 1, "core")
    return f"a machine with {cores} ({model}), Python {platform.python_version()}"


def claims(reports: Path) -> dict[str, pd.DataFrame]:
    """Tables of verdicts by testbed."""
    return {testbed: pd.read_csv(reports / testbed / "tables/claims.csv") for testbed in TESTBEDS}


if __name__ == "__main__":
    main()
