"""How well the moves of invented tasks are cut, over many sets of demonstrations.

    python benchmarks/example_cuts.py --first 101 --count 40
    python benchmarks/example_cuts.py --first 201 --count 40 --rows sessions wiping

Constants of the cutting were chosen on the sets 1 to 35. A row per kind of demonstrations has absolute errors
of all ends, in ms: against where a move is planned to begin and end, and against where its speed passes 5 %
of its peak (`seen`), which is a tenth of a second inside. Of sessions of 3 to 12 repeats the row says too in
how many all repeats were found; of wiping, where nothing rests and a force tells, errors are of the contacts.
"""

import argparse
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
from timing import at_least_one

from dissertation.simulation.hand_noise import hand_noise
from dissertation.simulation.pick_and_place import MOVES, SLOW, as_recording, session, takes
from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.core.signals import minimum_jerk
from structlearn.readers import synchronise
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation import SegmentParameters, cut
from structlearn.segmentation.repeats import split_repeats
from structlearn.tasks.task_entry import read_task

KINDS = {
    "plain": {},
    "twitch": {"twitch": True},
    "hesitation": {"hesitation": True},
    "both": {"twitch": True, "hesitation": True},
    "slow": {"hand": SLOW},  # and a hand that sways by 1 mm
}
ENDS = {"onset": ("onset", "wls"), "crossing": ("crossing", "wls"), "zero": ("crossing", "zvc")}
"""Ends of movements and method, by the words for them; `zero` is zero-velocity crossing alone."""

CONTACT_N, PRESSED_N_M = 2.0, 1500.0  # of wiping: force that says contact, and stiffness of what is wiped
WIPING = [
    {"name": "approach", "until": {"signal": "force", "above": CONTACT_N}},
    {"name": "wipe", "until": {"signal": "force", "below": CONTACT_N}},
    "retreat",
]


def cutting(primitives: object, ends: str) -> SegmentParameters:
    """Parameters of the public example, for other primitives and ends."""
    values = read_task("pick", Path("examples/pick.yaml")).segment
    return values.model_validate(values.model_dump() | {"primitives": primitives, "ends": ends})


def of_takes(seed: int, moves: int, kind: str, ends: str) -> pd.DataFrame:
    """Errors of one set, one row per end, and whether the cut is flagged; or why there is none."""
    made = takes(seed, moves, **KINDS[kind])
    demonstrations = [synchronise(as_recording(take), 200.0) for take in made]
    chosen, method = ENDS[ends]
    try:
        found = cut(demonstrations, cutting(moves, chosen))
    except InputError as fault:
        return pd.DataFrame([{"seed": seed, "fault": str(fault)}])
    rows = []
    flagged = set(zip(found.warnings["demonstration"], found.warnings["primitive"], strict=True))
    for take, demonstration in zip(made, demonstrations, strict=True):
        shift = take.planned[0, 0] - demonstration.true_segments[0, 0]
        for place, name in enumerate(found.primitives):
            times = found.result(name, method).loc[take.name, ["start_s", "end_s"]].to_numpy(float)
            off = [1e3 * np.abs(times + shift - true[place]) for true in (take.planned, take.segments)]
            rows += [(seed, *pair, (take.name, name) in flagged) for pair in zip(*off, strict=True)]
    return pd.DataFrame(rows, columns=["seed", "error_ms", "seen_ms", "flagged"])


def of_session(seed: int, ends: str) -> pd.DataFrame:
    """Errors of one session of 3 to 12 repeats, likewise, with whether all repeats were found as made."""
    repeats, odd, moves = 3 + seed % 10, bool(seed % 2), list(MOVES)[seed % len(MOVES)]
    take = session(seed, moves, repeats, twitch=odd, hesitation=odd)
    recorded = synchronise(as_recording(take), 200.0)
    chosen, method = ENDS[ends]
    try:
        parts, table = split_repeats([recorded], cutting(moves, chosen), None)
    except InputError as fault:
        return pd.DataFrame([{"seed": seed, "made": repeats, "fault": str(fault)}])
    row = {"seed": seed, "made": repeats, "found": len(parts)}
    if len(parts) != repeats:
        return pd.DataFrame([row | {"fault": f"{len(parts)} repeats, not {repeats}"}])
    by_repeat = recorded.true_segments.reshape(-1, moves, 2)
    inside = (table["start_s"] <= by_repeat[:, 0, 1]) & (table["end_s"] >= by_repeat[:, -1, 0])
    found, since = cut(parts, cutting(moves, chosen)), table.set_index("demonstration")["start_s"]
    rows = []
    for place, name in enumerate(found.primitives):
        for repeat, (one, times) in enumerate(found.result(name, method).loc[since.index].iterrows()):
            off = 1e3 * np.abs(times[["start_s", "end_s"]] + since[one] - by_repeat[repeat, place])
            flagged = one in set(found.warnings["demonstration"])
            rows += [row | {"as_made": inside.all(), "flagged": flagged, "error_ms": ms} for ms in off]
    return pd.DataFrame(rows)


def wiping(seed: int, count: int = 5) -> list[Demonstration]:
    """A board is wiped to and fro, or with odd seeds in circles, without a rest before or after.

    The hand already wipes when it comes down, and still wipes when it leaves, so that only the force tells.
    Contact is the second of the `true_segments`.
    """
    found = []
    for number, source in enumerate(np.random.SeedSequence([seed, 77]).spawn(count), 1):
        rng = np.random.default_rng(source)
        down, strokes, up = rng.uniform([1.0, 3.0, 0.8], [2.0, 5.0, 1.6])
        begins, dt = rng.uniform(0.5, 1.0), 1 / 200
        lifts = begins + down + strokes
        time = np.arange(0.0, lifts + up + rng.uniform(0.5, 1.0), dt)
        lowered = minimum_jerk(np.clip((time - begins) / down, 0, 1))
        raised = minimum_jerk(np.clip((time - lifts) / up, 0, 1))
        wiped = time - begins - 0.6 * down
        fades = np.clip(np.minimum(wiped, lifts + 0.4 * up - time) / 0.4, 0, 1)
        stroke = 2 * np.pi * wiped / rng.uniform(1.2, 2.0)
        side, along = 0.1 * minimum_jerk(fades) * np.array([np.sin(stroke), (seed % 2) * np.cos(stroke)])
        height = 0.25 - 0.255 * lowered + rng.uniform(0.2, 0.3) * raised  # pressed in by 5 mm
        position = np.stack([0.1 * lowered - 0.05 * raised + along, side, height], axis=1)
        contact = time[height < 0]
        noise, _ = hand_noise(np.gradient(position, dt, axis=0), height < 0, 0.5, 1 / dt, rng)
        force = np.zeros((len(time), 6))
        force[:, 2] = PRESSED_N_M * np.maximum(-(position + noise)[:, 2], 0.0)
        force[:, 1] = -0.3 * force[:, 2] * np.sign(np.gradient(side))
        force += 0.15 * rng.standard_normal(force.shape)
        ends = [begins, contact[0], contact[-1], lifts + up]
        segments = np.array(list(pairwise(ends)))
        found.append(Demonstration(f"{number}", time, position + noise, wrench=force, true_segments=segments))
    return found


def of_wiping(seed: int, ends: str) -> pd.DataFrame:
    """Errors of the cuts at contact and at its end, of one set."""
    made, (chosen, method) = wiping(seed), ENDS[ends]
    try:
        found = cut(made, cutting(WIPING, chosen))
    except InputError as fault:
        return pd.DataFrame([{"seed": seed, "fault": str(fault)}])
    wiped = found.result("wipe", method).loc[[one.name for one in made], ["start_s", "end_s"]]
    off = 1e3 * np.abs(wiped - np.array([one.true_segments[1] for one in made]))
    flagged = wiped.index.isin(found.warnings["demonstration"])
    return pd.DataFrame({"seed": seed, "error_ms": np.ravel(off), "flagged": np.repeat(flagged, 2)})


def summary(name: str, table: pd.DataFrame) -> dict[str, object]:
    """One row of what is printed, from the errors of all sets."""
    columns = ["seed", "error_ms", "seen_ms", "flagged", "fault", "made", "found", "as_made"]
    table = table.reindex(columns=columns)
    far, flagged = table["error_ms"] > 150.0, table["flagged"].eq(True)
    sets, off = table.groupby("seed").first(), table["error_ms"]
    return {
        "row": name,
        "sets": len(sets),
        "not_cut": table["fault"].notna().sum(),
        "ends": off.notna().sum(),
        "mean_ms": off.mean(),
        "p95_ms": off.quantile(0.95),
        "max_ms": off.max(),
        "beyond_150_ms": far.sum(),
        "of_them_not_flagged": (far & ~flagged).sum(),
        "flagged": flagged.sum() // 2,
        "seen_mean_ms": table["seen_ms"].mean(),
        "repeats_made": sets["made"].sum(),
        "repeats_found": sets["found"].sum(),
        "sessions_as_made": sets["as_made"].eq(True).sum(),
    }


def main() -> None:
    """Print a row per kind of demonstrations and number of moves as soon as it is known."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--first", type=int, default=101)
    arguments.add_argument("--count", type=at_least_one, default=40)
    arguments.add_argument("--ends", choices=ENDS, default="onset")
    names = [*KINDS, "sessions", "wiping"]
    arguments.add_argument("--rows", choices=names, nargs="+", default=names)
    given = arguments.parse_args()
    work = {
        f"{kind}, {moves} moves": partial(of_takes, moves=moves, kind=kind)
        for kind in KINDS
        for moves in MOVES
    }
    work |= {"sessions": of_session, "wiping": of_wiping}
    header = True
    for name, errors in work.items():
        if name.split(",")[0] not in given.rows:
            continue
        sets = parallel_map(
            partial(errors, ends=given.ends), range(given.first, given.first + given.count), "sets"
        )
        table = pd.concat(sets, ignore_index=True)
        row = pd.DataFrame([summary(name, table)]).round(1)
        print(row.to_csv(index=False, header=header), end="", flush=True)
        for fault in table.get("fault", pd.Series(dtype=str)).dropna():
            print("#", fault)
        header = False


if __name__ == "__main__":
    main()
