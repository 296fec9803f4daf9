"""How well the moves of the invented task are cut, over many sets of demonstrations.

    python benchmarks/example_cuts.py --first 101 --count 40

Constants of the cutting were chosen on the sets 1 to 35. Errors are against where a move is planned to begin
and end, and against where its speed passes 5 % of its peak, which is a tenth of a second inside. Of sessions
of 3 to 12 repeats, a row says in how many all repeats were found, and how well they were cut.
"""

import argparse
from functools import partial

import numpy as np
import pandas as pd

from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.readers import synchronise
from structlearn.segmentation.repeats import split
from structlearn.segmentation.segments import cut
from structlearn.tasks.pick_and_place_world import MOVES, SLOW, as_recording, session, takes
from structlearn.tasks.task_entry import read_task

KINDS = {
    "plain": {},
    "twitch": {"twitch": True},
    "hesitation": {"hesitation": True},
    "both": {"twitch": True, "hesitation": True},
    "slow": {"hand": SLOW},  # and a hand that sways by 1 mm
}


def errors_ms(seed: int, moves: int, kind: str, ends: str) -> pd.DataFrame:
    """Absolute errors of one set, one row per end, and whether the cut is doubted; or why there is none."""
    task = read_task("pick")
    parameters = task.segment.model_validate(task.segment.model_dump() | {"primitives": moves, "ends": ends})
    made = takes(seed, moves, **KINDS[kind])
    demonstrations = [synchronise(as_recording(take), task.clock.rate_hz) for take in made]
    try:
        found = cut(demonstrations, parameters)
    except InputError as fault:
        return pd.DataFrame([{"seed": seed, "fault": str(fault)}])
    rows = []
    doubted = set(zip(found.doubts["demonstration"], found.doubts["primitive"], strict=True))
    for take, demonstration in zip(made, demonstrations, strict=True):
        shift = take.segments[0, 0] - demonstration.true_segments[0, 0]
        for place, (name, table) in enumerate(found.results.items()):
            ends = table.loc[take.name, ["start_s", "end_s"]].to_numpy(float)
            planned, seen = (
                1e3 * np.abs(ends - (true[place] - shift)) for true in (take.planned, take.segments)
            )
            doubt = (take.name, name) in doubted
            rows += [(seed, *pair, doubt) for pair in zip(planned, seen, strict=True)]
    return pd.DataFrame(rows, columns=["seed", "planned_ms", "seen_ms", "doubted"])


def session_errors_ms(seed: int, ends: str) -> dict[str, float]:
    """One session: repeats that were made and found, and absolute errors of cuts without a warning."""
    task, repeats, odd = read_task("pick"), 3 + seed % 10, bool(seed % 2)
    moves = list(MOVES)[seed % len(MOVES)]
    parameters = task.segment.model_validate(task.segment.model_dump() | {"primitives": moves, "ends": ends})
    take = session(seed, moves, repeats, twitch=odd, hesitation=odd)
    recorded = synchronise(as_recording(take), task.clock.rate_hz)
    parts, table = split([recorded], parameters, None)
    planned = take.planned - take.segments[0, 0] + recorded.true_segments[0, 0]
    by_repeat = planned.reshape(repeats, moves, 2)
    row = {"made": repeats, "found": len(parts), "as_made": False, "doubted": 0}
    if len(parts) != repeats:
        return row
    inside = (table["start_s"] <= by_repeat[:, 0, 1]) & (table["end_s"] >= by_repeat[:, -1, 0])
    found = cut(parts, parameters)
    kept = ~table["demonstration"].isin(found.doubts["demonstration"]).to_numpy()
    ends = [its[["start_s", "end_s"]].to_numpy() for its in found.results.values()]
    errors = np.stack(ends, axis=1) + table["start_s"].to_numpy()[:, None, None] - by_repeat
    far = 1e3 * np.abs(errors[kept])
    return row | {
        "as_made": bool(inside.all()),
        "doubted": int((~kept).sum()),
        "mean_ms": far.mean(),
        "p95_ms": np.quantile(far, 0.95),
        "max_ms": far.max(),
    }


def summary(kind: str, moves: int, table: pd.DataFrame) -> dict[str, object]:
    """One row of what is printed, from the rows of `errors_ms` of all sets."""
    far = table["planned_ms"] > 150.0
    doubted = table["doubted"].fillna(False).astype(bool)
    return {
        "kind": kind,
        "moves": moves,
        "sets": table["seed"].nunique(),
        "not_cut": table["fault"].notna().sum(),
        "mean_ms": table["planned_ms"].mean(),
        "max_ms": table["planned_ms"].max(),
        "ends": table["planned_ms"].notna().sum(),
        "beyond_150_ms": far.sum(),
        "of_them_undoubted": (far & ~doubted).sum(),
        "doubted": doubted.sum() // 2,
        "seen_mean_ms": table["seen_ms"].mean(),
        "seen_max_ms": table["seen_ms"].max(),
    }


def main() -> None:
    """Print a row per kind of demonstrations and number of moves as soon as it is known."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--first", type=int, default=101)
    arguments.add_argument("--count", type=int, default=40)
    arguments.add_argument("--ends", choices=("onset", "crossing"), default="onset")
    chosen = arguments.parse_args()
    seeds = range(chosen.first, chosen.first + chosen.count)
    header = True
    for kind in KINDS:
        for moves in (2, 3, 5):
            sets = parallel_map(partial(errors_ms, moves=moves, kind=kind, ends=chosen.ends), seeds, "sets")
            columns = ["seed", "planned_ms", "seen_ms", "doubted", "fault"]
            table = pd.concat([one.reindex(columns=columns) for one in sets], ignore_index=True)
            row = pd.DataFrame([summary(kind, moves, table)]).round(1)
            print(row.to_csv(index=False, header=header), end="", flush=True)
            for fault in table["fault"].dropna():
                print("#", fault)
            header = False
    sessions = pd.DataFrame(parallel_map(partial(session_errors_ms, ends=chosen.ends), seeds, "sessions"))
    totals = sessions[["made", "found", "as_made", "doubted"]].sum()
    row = {"sessions": len(sessions)} | totals.to_dict()
    row |= sessions[["mean_ms", "p95_ms"]].mean().round(1).to_dict() | {
        "max_ms": round(sessions["max_ms"].max())
    }
    print(pd.DataFrame([row]).to_csv(index=False), end="")


if __name__ == "__main__":
    main()
