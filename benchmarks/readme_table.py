"""The README's table of timings, from `reports/benchmarks/table.csv`: each work beside its fastest peer."""

from pathlib import Path

import pandas as pd

TABLE = Path(__file__).parents[1] / "reports/benchmarks/table.csv"

LABELS = {
    "fit 11 x 1000 x 3, 25 kernels, from positions": "fit 11 demonstrations",
    "unroll 1 x 1000 x 3": "run a primitive",
    "unroll 38 x 1000 x 3": "run 38 at once",
    "unroll 1 x 1000 x 3 with a 38-100-25-1 network": "run with a network",
    "PMNN training, 1 fold, 400 steps": "train a network",
    "PI2-CMA update 38 x 75: with the samples drawn": "policy search, update",
    "DTW with path 3000^2, 1-D": "warp 3000 samples",
    "geodesics, 2310^2 distances on a skin": "geodesics",
    "inverse dynamics, 6000 states one by one: by a compiled model": "torques of learned models",
    "inverse dynamics, 6000 states one by one: in one compiled call": "torques of 6000 states",
    "forward dynamics, 6000 states one by one: in one compiled call": "accelerations of 6000 states",
    "regressor, 6000 states": "regressors of 6000 states",
    "regressor, 6000 states: a single state": "regressor of one state",
    "DeLaN epoch, 6000 samples, forward + gradient": "epoch of DeLaN",
    "reading a bag of 283.5 MB, three topics of 1 kHz beside a camera": "read a bag of 284 MB",
}
"""Works that the README shows, by their names in `table.csv`; whatever a peer does faster is among them."""


def fastest_peers(table: pd.DataFrame) -> pd.DataFrame:
    """A row per work that has peers, indexed by its name; a variant's name begins with that of its work."""
    whole = table["work"].where(~table["work"].str.startswith(" ")).ffill()
    names = whole.where(whole == table["work"], whole + ": " + table["work"].str.strip())
    timed = table.assign(work=names).dropna(subset=["peer"])
    return timed.sort_values("peer_median_ms", kind="stable").drop_duplicates("work").set_index("work")


def markdown(table: pd.DataFrame) -> str:
    """The README's lines, the faster peers in bold. Raises KeyError: `table` lacks a work that is shown."""
    lines = ["| work | ms | fastest peer, ms |", "|---|---|---|"]
    for row in fastest_peers(table).loc[list(LABELS)].itertuples():
        peer = f"{row.peer.split()[0].rstrip(',')} {_digits(row.peer_median_ms)}"
        lines.append(
            f"| {LABELS[row.Index]} | {_digits(row.median_ms)} | {f'**{peer}**' if row.ratio < 1 else peer} |"
        )
    return "\n".join(lines) + "\n"


def _digits(value: float) -> str:
    """Three of them, and all that stand before the point."""
    return f"{value:.0f}" if value >= 1000.0 else f"{value:.3g}"


if __name__ == "__main__":
    print(markdown(pd.read_csv(TABLE)), end="")
