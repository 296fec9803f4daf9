"""Compare what the pipeline made with the last commit: all of it is as committed, or what differs is named.

    python -m dissertation.evidence.committed

Results have the same bits on every processor that the README names, so a run of the committed code and
parameters ends with `as committed: 238 of 238 rows, 331 of 331 files`. Otherwise it prints each verdict that
changed and each file that differs. Rows are those of verdict tables; files are the outputs that git keeps,
README (its table of findings) and `dvc.lock` (digests of all data), in which only recordings for the viewer,
whose identifiers are random, may differ.
"""

import csv
import re
import subprocess
import sys
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

if TYPE_CHECKING:
    import pandas as pd

TABLES = "reports/*/tables/claims.csv"
LOCK = "dvc.lock"
RECORDING = re.compile(r"^    - path: reports/rerun/.*\n(?:      .*\n)+", re.MULTILINE)
"""A recording in the lock."""
LISTED = 20
"""Files that are named; more are counted."""


def main() -> None:
    """Print the verdicts and files that differ from the last commit, and how many do not."""
    try:
        files, other = pipeline_files(), other_files()
        tables = [path for path in files if Path(path).match(TABLES)]
        if _git("status", "--porcelain", "--", TABLES):
            same, rows = _print_verdicts({Path(path).parts[1] for path in tables})
        else:
            same = rows = sum(_rows(path) for path in tables)
    except (OSError, subprocess.CalledProcessError) as error:
        sys.exit(f"nothing to compare with: {(getattr(error, 'stderr', '') or str(error)).strip()}")
    for path in other[:LISTED]:
        print(f"differs from the last commit: {path}")
    if len(other) > LISTED:
        print(f"differ from the last commit: {len(other) - LISTED} more files")
    print(f"as committed: {same} of {rows} rows, {len(files) - len(other)} of {len(files)} files")


def pipeline_files() -> list[str]:
    """Files that the pipeline writes and git keeps. Raises CalledProcessError: there is no commit."""
    listed = _git("ls-files", "--cached", "--others", "--exclude-standard", "-z", "--", *_outputs())
    return sorted({*listed.split("\0")} - {""})


def other_files() -> list[str]:
    """Those of `pipeline_files` that differ from the last commit."""
    listed = _git("status", "--porcelain", "--untracked-files=all", "--no-renames", "-z", "--", *_outputs())
    names = sorted(entry[3:] for entry in listed.split("\0") if entry)
    if LOCK in names:
        here, there = Path(LOCK).read_text(), _git("show", f"HEAD:./{LOCK}")
        if RECORDING.sub("", here) == RECORDING.sub("", there):
            names.remove(LOCK)
    return names


def written() -> "dict[str, pd.DataFrame]":
    """Claims tables of the working tree, by testbed."""
    return {path.parts[1]: _table(path.read_text(encoding="utf-8")) for path in sorted(Path().glob(TABLES))}


def committed(commit: str = "HEAD") -> "dict[str, pd.DataFrame]":
    """Claims tables of a commit, by testbed. Raises CalledProcessError: there is no such commit."""
    found = [Path(name) for name in _git("ls-tree", "-r", "--name-only", commit, "reports").splitlines()]
    tables = [path for path in found if path.match(TABLES)]
    return {path.parts[1]: _table(_git("show", f"{commit}:./{path.as_posix()}")) for path in tables}


def _print_verdicts(testbeds: set[str]) -> tuple[int, int]:
    """Print verdicts that changed; return how many rows of some testbeds are the same, and of how many."""
    # seldom needed, and slow to import
    from dissertation.evidence.verdicts import QUOTED, SAME, changes, compared

    table = compared(committed(), written())
    print(*(changes(table) or ["no verdict changed"]), sep="\n")
    outcomes = table.loc[table["testbed"].isin(testbeds), "outcome"]
    return int(outcomes.isin([SAME, QUOTED]).sum()), len(outcomes)


def _outputs() -> list[str]:
    """Paths of outputs that are not in DVC's cache, of README and of the lock."""
    stages: dict[str, Any] = yaml.load(Path("dvc.yaml").read_text(), Loader=yaml.CSafeLoader)["stages"]
    outs = [out for stage in stages.values() for kind in ("outs", "metrics") for out in stage.get(kind, [])]
    return [*(path for out in outs if isinstance(out, dict) for path in out), LOCK, "README.md"]


def _rows(path: str) -> int:
    """Number of rows of a table that was written."""
    with Path(path).open(newline="", encoding="utf-8") as file:
        return sum(1 for _ in csv.reader(file)) - 1


def _table(text: str) -> "pd.DataFrame":
    import pandas as pd  # seldom needed

    return pd.read_csv(StringIO(text), dtype=str, keep_default_na=False)


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], capture_output=True, text=True, check=True).stdout


if __name__ == "__main__":
    main()
