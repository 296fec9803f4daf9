"""Damage many files and read them: `make faults N=10000`.

Seeds below 1000 are the tests'. Writes `reports/reliability`: how often reading came to what, by kind of file
and of damage; names each case that breaks the rule.
"""

import argparse
import sys
import tempfile
from collections import Counter
from functools import partial
from pathlib import Path

from faults.reliability import keep, outcome_table
from faults.specimens import SPECIMENS
from faults.trial import NAMED, OTHER, OUTCOMES, SAME, fingerprint, outcome

from structlearn.core.parallel import parallel_map

BATCH = 50  # mutants that a process takes at a time


def main() -> None:
    """Try them, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=10_000, help="damaged files in all")
    parser.add_argument("--first", type=int, default=1000, help="seed of the first of each kind of file")
    given = parser.parse_args()
    each = -(-given.count // len(SPECIMENS))
    batches = [
        (name, given.first + begin, min(BATCH, each - begin))
        for begin in range(0, each, BATCH)
        for name in SPECIMENS
    ]
    with tempfile.TemporaryDirectory() as folder:
        found = parallel_map(partial(batch, folder=folder), batches, "damaged files", local=True)
    counts, broken = (
        sum((counts for counts, _ in found), Counter()),
        [line for _, lines in found for line in lines],
    )
    rows = [(*key, count) for key, count in sorted(counts.items())]
    table = outcome_table(rows, ["file", "checksums", "damage"], OUTCOMES)
    came = {outcome: int(table[outcome].sum()) for outcome in OUTCOMES}
    silent = int(table.loc[table["checksums"] == "yes", OTHER].sum())
    metrics = {outcome.replace(" ", "_"): its for outcome, its in came.items()}
    metrics |= {"files": sum(came.values()), "silent": silent, "broken": len(broken)}
    keep("faults", table, f"make faults N={given.count}", metrics)
    print(table.groupby("file").sum(numeric_only=True).to_string())
    if broken:
        sys.exit("\n".join(["error: the rule is broken:", *broken]))


def batch(work: tuple[str, int, int], folder: str) -> tuple[Counter, list[str]]:
    """Outcomes of some seeds of a kind of file, and the cases that break the rule."""
    name, first, count = work
    specimen, path = SPECIMENS[name], Path(folder, f"{first} {Path(name).name}", name)
    path.parent.mkdir(parents=True)
    specimen.write(path)
    content, sound = path.read_bytes(), fingerprint(specimen.read(path))
    allowed = {SAME, NAMED} if specimen.signed else {SAME, NAMED, OTHER}
    counts: Counter = Counter()
    broken = []
    for seed in range(first, first + count):
        kind, damaged = specimen.damage(content, seed)
        path.write_bytes(damaged)
        came, said = outcome(specimen.read, path, sound)
        counts[Path(name).name, "yes" if specimen.signed else "no", kind, came] += 1
        if came not in allowed:
            broken.append(f"{name}, seed {seed}, {kind}: {came}: {said}")
    path.unlink()
    return counts, broken


if __name__ == "__main__":
    main()
