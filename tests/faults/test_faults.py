"""Some damaged files of every kind; `make faults N=100000` tries any number."""

import pytest
from faults.many import batch
from faults.specimens import SPECIMENS
from faults.trial import NAMED

COUNT = 10  # of each kind of file


@pytest.mark.parametrize("name", SPECIMENS)
def test_damage_is_the_same_data_or_one_line(tmp_path, name):
    counts, broken = batch((name, 0, COUNT), str(tmp_path))
    assert broken == []
    assert sum(count for (*_, came), count in counts.items() if came == NAMED) > COUNT / 5  # damage is damage
