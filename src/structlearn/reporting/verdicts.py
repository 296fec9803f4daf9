"""Verdicts of the working tree that differ from the committed ones.

    python -m structlearn.reporting.verdicts

Digits depend on the processor, so a run elsewhere changes many files of `reports/`; what matters is whether
a verdict became another word. One line per row of `reports/*/tables/claims.csv` that did, from the commit to
the working tree.
"""

import subprocess
import sys
from io import StringIO
from pathlib import Path

import pandas as pd

from structlearn.reporting.other_processor import changes, compared

TABLES = "reports/*/tables/claims.csv"


def main() -> None:
    """Print what changed since the last commit."""
    try:
        lines = changes(compared(committed(), written()))
    except subprocess.CalledProcessError as error:
        sys.exit(f"error: {error.stderr.strip()}")
    print(*(lines or ["no verdict changed"]), sep="\n")


def written() -> dict[str, pd.DataFrame]:
    """Tables of claims in the working tree, by testbed."""
    return {path.parts[1]: _table(path.read_text(encoding="utf-8")) for path in sorted(Path().glob(TABLES))}


def committed(commit: str = "HEAD") -> dict[str, pd.DataFrame]:
    """Tables of claims of a commit, by testbed.

    Raises:
        subprocess.CalledProcessError: this is no repository, or it has no such commit.
    """
    found = [Path(name) for name in _git("ls-tree", "-r", "--name-only", commit, "reports").splitlines()]
    tables = [path for path in found if path.match(TABLES)]
    return {path.parts[1]: _table(_git("show", f"{commit}:./{path.as_posix()}")) for path in tables}


def _table(text: str) -> pd.DataFrame:
    return pd.read_csv(StringIO(text), dtype=str, keep_default_na=False)


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], capture_output=True, text=True, check=True).stdout


if __name__ == "__main__":
    main()
