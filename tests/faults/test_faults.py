"""Some hundred damaged files of every kind; `make faults N=100000` tries any number."""

from collections import Counter

import pytest
from faults.mutants import mutant
from faults.specimens import SPECIMENS
from faults.trial import NAMED, OTHER, SAME, fingerprint, outcome

COUNT = 25
"""Of each kind of file."""


@pytest.mark.parametrize("name", SPECIMENS)
def test_damage_is_the_same_data_or_one_line(tmp_path, name):
    specimen, path = SPECIMENS[name], tmp_path / name
    path.parent.mkdir(parents=True, exist_ok=True)
    specimen.write(path)
    content, sound = path.read_bytes(), fingerprint(specimen.read(path))
    found = Counter()
    for seed in range(COUNT):
        kind, damaged = mutant(content, seed)
        path.write_bytes(damaged)
        came, said = outcome(specimen.read, path, sound)
        allowed = (SAME, NAMED) if specimen.signed else (SAME, NAMED, OTHER)
        assert came in allowed, f"{kind}, seed {seed}: {came}: {said}"
        found[came] += 1
    assert found[NAMED] > COUNT / 5  # damage is damage
