"""How well the moves of the invented task are cut, over many sets of demonstrations.

    python benchmarks/example_cuts.py --first 101 --count 40

Constants of the cutting were chosen on the sets 1 to 5. Errors are against where a move is planned to begin and
end, and against where its speed passes 5 % of its peak, which is later and earlier by a tenth of a second.
"""

import argparse
from functools import partial

import numpy as np
import pandas as pd

from structlearn.ground.errors import InputError
from structlearn.ground.parallel import parallel_map
from structlearn.recordings import synchronise
from structlearn.segmentation.segments import cut
from structlearn.testbeds.own.task import read_task
from structlearn.testbeds.own.world.pick_and_place import as_recording, takes

KINDS = {
    "plain": {},
    "twitch": {"twitch": True},
    "hesitation": {"hesitation": True},
    "both": {"twitch": True, "hesitation": True},
}


def errors_ms(seed: int, moves: int, kind: str) -> pd.DataFrame:
    """Absolute errors of one set: `planned_ms`, `seen_ms`, one row per end; whether they are doubted; or the fault."""
    task = read_task("pick")
    parameters = task.segment.model_validate(task.segment.model_dump() | {"primitives": moves})
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


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--first", type=int, default=101)
    arguments.add_argument("--count", type=int, default=40)
    chosen = arguments.parse_args()
    seeds = range(chosen.first, chosen.first + chosen.count)
    rows = []
    for kind in KINDS:
        for moves in (2, 3, 5):
            sets = parallel_map(partial(errors_ms, moves=moves, kind=kind), seeds, "sets")
            table = pd.concat(sets, ignore_index=True).reindex(
                columns=["seed", "planned_ms", "seen_ms", "doubted", "fault"]
            )
            rows.append(
                {
                    "kind": kind,
                    "moves": moves,
                    "sets": chosen.count,
                    "not_cut": table["fault"].notna().sum(),
                    "mean_ms": table["planned_ms"].mean(),
                    "max_ms": table["planned_ms"].max(),
                    "beyond_150_ms": (table["planned_ms"] > 150).sum(),
                    "of_them_undoubted": ((table["planned_ms"] > 150) & (table["doubted"] == False)).sum(),  # noqa: E712
                    "doubted": (table["doubted"] == True).sum() // 2,  # noqa: E712
                    "seen_mean_ms": table["seen_ms"].mean(),
                    "seen_max_ms": table["seen_ms"].max(),
                }
            )
            print(
                pd.DataFrame(rows[-1:]).round(1).to_csv(index=False, header=len(rows) == 1),
                end="",
                flush=True,
            )
            for fault in table["fault"].dropna():
                print("#", fault)


if __name__ == "__main__":
    main()
