import hashlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from structlearn.core.errors import InputError
from structlearn.readers.foreign_tables import PublicSet, read_stamped_table, read_table, uniform_stamps


@pytest.fixture
def log(tmp_path):
    def write(text):
        path = tmp_path / "log.txt"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def test_white_space_blank_lines_a_header_commas_and_one_at_the_end_of_lines(log):
    table = read_table(log("1 2.5\t-3e2\n\n  4   5 6 \n\n"), 3)
    np.testing.assert_array_equal(table, [[1, 2.5, -300], [4, 5, 6]])
    table = read_table(log("time,a, b\r\n1,2,3,\r\n4,5,6\r\n"), 3, separator=",", header_lines=1)
    np.testing.assert_array_equal(table, [[1, 2, 3], [4, 5, 6]])


@given(stamp=st.integers(-(10**18), 4 * 10**18))
def test_any_printed_time_is_read_exactly(tmp_path_factory, stamp):
    path = tmp_path_factory.mktemp("time") / "log.txt"
    sign = "-" if stamp < 0 else ""
    path.write_text(f"{sign}{abs(stamp) // 10**9}.{abs(stamp) % 10**9:09d} 0\n")
    stamps, _ = read_stamped_table(path, 2)
    assert stamps.tolist() == [stamp]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("1 2\n3\n", "line 2 has 1 columns, expected 2"),
        ("1 2\n\n1 2 3\n", "line 3 has 3 columns, expected 2"),
        ("1 2\n3 four\n", "line 2: not a number: 'four'"),
        ("1 nan\n", "line 1: not a finite number: 'nan'"),
        ("1 2\n1 -inf\n", "line 2: not a finite number: '-inf'"),
        ("", "has no rows"),
        (b"\xff\xfe1 2\n", "not a text file"),
    ],
)
@pytest.mark.parametrize("read", [read_table, read_stamped_table])
def test_faults_are_named_with_file_and_line(log, read, text, complaint):
    with pytest.raises(InputError, match=rf"log\.txt: {complaint}"):
        read(log(text), 2)
    for time in ("noon", "1e30", "1e999999"):
        with pytest.raises(InputError, match=rf"log\.txt: line 1: .*time .*: '{time}'"):
            read_stamped_table(log(f"{time} 1\n"), 2)


def test_uniform_stamps_do_not_drift():
    stamps = uniform_stamps(30_001, 300.0)
    assert stamps[0] == 0
    assert stamps[-1] == 100 * 10**9
    assert set(np.diff(stamps).tolist()) == {3333333, 3333334}


def test_provenance_has_the_files_and_their_digests(tmp_path):
    (tmp_path / "set").mkdir()
    files = [tmp_path / "set" / "1.txt", tmp_path / "set" / "2.txt"]
    for file in files:
        file.write_text(file.name)
    provenance = PublicSet("https://example.org", "abc", "MIT").provenance(tmp_path, files)
    assert provenance["origin"] == "recorded"
    assert provenance["files"] == "set/1.txt set/2.txt"
    assert provenance["sha256"] == " ".join(hashlib.sha256(f.name.encode()).hexdigest() for f in files)
