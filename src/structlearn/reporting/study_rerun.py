"""Part of one cell of a study, run again: does the present code still give what its table says?

A whole study takes an hour. What of one cell (a variant and a repeat) can be run in 20 s is a script beside
the study's description, `benchmarks/studies/<testbed>/<name>.py`, which writes numbers. They are held against
the table, and where this has no such number against those that were kept beside it when it was made.
"""

import copy
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from structlearn.core.artefacts import Metrics, read_metrics
from structlearn.core.errors import InputError
from structlearn.core.params import read_values
from structlearn.reporting.source_commit import code_digests, source_commit
from structlearn.reporting.studies import DESCRIPTIONS, Changes, Description, Rerun, Study, repeats

TOLERANCE = 1e-3
"""Relative; on a processor of another kind than the table's, whose kernels round in another order."""


def run_part(name: str, description: Description, root: Path = Path(".")) -> Metrics:
    """Numbers of the part of a cell that a study's description names.

    Raises:
        InputError: the script failed.
    """
    root = root.resolve()
    cell = description.rerun
    assert cell is not None
    changes = description.variants[cell.variant] | repeats(description, root / "params.yaml")[cell.repeat]
    path = os.pathsep.join(filter(None, [str(root / "src"), os.environ.get("PYTHONPATH")]))
    with tempfile.TemporaryDirectory() as folder:
        values = changed(read_values(root / "params.yaml"), changes)
        Path(folder, "params.yaml").write_text(yaml.safe_dump(values), encoding="utf-8")
        script = root / DESCRIPTIONS / f"{name}.py"
        done = subprocess.run(
            [sys.executable, script],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": path},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise InputError(f"{script}: {(done.stderr.strip() or 'failed').splitlines()[-1]}")
        return read_metrics(Path(folder, "numbers.json"))


def changed(values: Mapping[str, object], changes: Changes) -> dict[str, object]:
    """Parameters with some of them changed, by their dotted keys."""
    result = copy.deepcopy(dict(values))
    for key, value in changes.items():
        *parents, last = key.split(".")
        place: Any = result
        for part in parents:
            place = place[part]
        place[last] = value
    return result


def compare(found: Metrics, study: Study, description: Description, root: Path = Path(".")) -> Rerun:
    """Numbers that `run_part` found anew beside those of the study."""
    cell, made, here = description.rerun, study.made, processor()
    assert cell is not None
    assert made is not None
    table = study.table
    row = table[(table["variant"] == cell.variant) & (table["repeat"] == cell.repeat)].iloc[0]
    known_on = {made.processor} | ({made.rerun.processor} if made.rerun and made.rerun.exact else set())
    exact = here in known_on or known_on == {""}  # the first time, who knows: as if it were the same
    known = {key: row[key] for key in found if key in row.index} | made.beside
    return Rerun(
        commit=source_commit(root=root),
        code=code_digests(made.code, root),
        processor=here,
        exact=exact,
        covers=cell.covers,
        compared=len(found),
        in_table=sum(key in row.index for key in found),
        different=sorted(
            key for key, value in found.items() if key not in known or not _alike(value, known[key], exact)
        ),
    )


def processor() -> str:
    """The kind of processor that compiled code is made for, which libraries choose their kernels by too."""
    from llvmlite import binding

    return os.environ.get("NUMBA_CPU_NAME") or binding.get_host_cpu_name()


def _alike(first: Any, second: Any, exact: bool) -> bool:
    if exact:  # six digits are kept
        return f"{float(first):.6g}" == f"{float(second):.6g}"
    return abs(first - second) <= TOLERANCE * max(abs(first), abs(second))
