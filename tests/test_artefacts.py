import errno
import json
import multiprocessing
import os
import re
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pandas as pd
import pytest

from structlearn.core import artefacts
from structlearn.core.errors import InputError

TABLE = pd.DataFrame(
    {"name": ["a", "b", "c"] * 2000, "value": np.linspace(0, 1, 6000) ** 0.5, "count": np.arange(6000)}
)
TENSORS = {"weights": np.arange(12.0).reshape(4, 3), "axes": np.eye(3)[:, ::-1].T, "duration": np.array(1.5)}


@pytest.mark.parametrize("old", [None, "old"])
@pytest.mark.parametrize(
    "error",
    [RuntimeError("killed"), *(OSError(one, os.strerror(one), "x") for one in (errno.ENOSPC, errno.EROFS))],
)
def test_a_file_is_published_whole_or_not_at_all(tmp_path, old, error):
    """A disk that cannot be written is named in one line."""
    target = tmp_path / "data/deep/note.txt"
    if old:
        with artefacts.publish(target) as path:
            assert path.suffix == ".txt"
            path.write_text(old)
            assert not target.exists()
        assert target.read_text() == old

    def fail():
        with artefacts.publish(target) as path:
            path.write_text("half")
            raise error

    disk = isinstance(error, OSError)
    words = f"note.txt: cannot be written: {error.strerror}" if disk else "killed"
    with pytest.raises(InputError if disk else RuntimeError, match=words):
        fail()
    assert [entry.read_text() for entry in target.parent.iterdir()] == ([old] if old else [])


@pytest.mark.parametrize("writes_half", [True, False])
def test_a_folder_is_replaced_by_a_whole_one_only(tmp_path, writes_half):
    target = tmp_path / "logs"

    def write(name, fails=False):
        with artefacts.publish(target) as path:
            if writes_half or not fails:
                path.mkdir()
                (path / name).write_text(name)
            if fails:
                raise FileNotFoundError("killed")

    write("first")
    write("second")
    aside = tmp_path / ".publish-logs" / "replaced"  # where a run was killed between two moves
    aside.parent.mkdir()
    target.rename(aside)
    with pytest.raises(FileNotFoundError):
        write("third", fails=True)
    assert [entry.name for entry in target.iterdir()] == ["second"]
    assert list(tmp_path.iterdir()) == [target]


WRITERS = {
    "table.parquet": lambda path: artefacts.write_table(TABLE, path),
    "tensors.safetensors": lambda path: artefacts.write_tensors(TENSORS, path, "test"),
    "metrics.json": lambda path: artefacts.write_metrics({"error": 0.1, "runs": 3}, path),
    "table.csv": lambda path: artefacts.write_csv(TABLE, path),
}


@pytest.mark.parametrize("name", WRITERS)
def test_the_same_data_give_the_same_bytes(tmp_path, name):
    for folder in ("once", "again"):
        WRITERS[name](tmp_path / folder / name)
    assert (tmp_path / "once" / name).read_bytes() == (tmp_path / "again" / name).read_bytes()


def test_a_table_comes_back_and_its_index_does_not_matter(tmp_path):
    artefacts.write_table(TABLE.set_index(TABLE.index[::-1]), tmp_path / "t.parquet")
    pd.testing.assert_frame_equal(artefacts.read_table(tmp_path / "t.parquet"), TABLE)
    artefacts.write_table(TABLE, tmp_path / "u.parquet")
    assert (tmp_path / "t.parquet").read_bytes() == (tmp_path / "u.parquet").read_bytes()
    assert b"pandas" not in (tmp_path / "t.parquet").read_bytes()  # its version would change the bytes


@pytest.mark.parametrize(
    ("swapped", "complaint"),
    [(b"ba", "damaged.*columns are not as written"), (b"\xff\xfe", "not a readable")],
)
def test_pages_that_the_footer_ascribes_to_another_column_are_an_error(tmp_path, swapped, complaint):
    """No checksum of Parquet covers its footer."""
    path = tmp_path / "table.parquet"
    artefacts.write_table(pd.DataFrame({"a": [1.0, 2.0], "b": [3.0, 4.0]}), path)
    before = b"\x19\x18\x01"  # of a column's path, in the description of its pages
    pages, between, rest = re.split(before + b"[ab]", path.read_bytes())
    path.write_bytes(pages + before + swapped[:1] + between + before + swapped[1:] + rest)
    with pytest.raises(InputError, match=f"table.parquet: .*{complaint}"):
        artefacts.read_table(path)


def test_tensors_come_back_with_their_shapes(tmp_path):
    path = tmp_path / "t.safetensors"
    artefacts.write_tensors(TENSORS, path, "what this is")
    found = artefacts.read_tensors(path)
    assert artefacts.read_description(path) == "what this is"
    assert found.keys() == TENSORS.keys()
    for name, tensor in TENSORS.items():
        assert found[name].shape == tensor.shape  # also of a single number
        np.testing.assert_array_equal(found[name], tensor)


@pytest.mark.parametrize("bad", [np.nan, -np.inf])
@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_a_tensor_with_a_value_that_is_none_is_named(tmp_path, bad, kind):
    path = tmp_path / "t.safetensors"
    artefacts.write_tensors({"sound": np.eye(2), "count": np.arange(3), "spoilt": kind([0, bad])}, path, "")
    with pytest.raises(InputError, match=re.escape(f"{path}: spoilt holds a value that is not finite")):
        artefacts.read_tensors(path)


READERS = [
    (artefacts.read_table, "table.parquet", "not a readable Parquet file"),
    (artefacts.read_tensors, "tensors.safetensors", "not a readable safetensors file"),
    (artefacts.read_description, "tensors.safetensors", "not a readable safetensors file"),
    (artefacts.read_metrics, "metrics.json", "not a JSON file"),
]


@pytest.mark.parametrize(("read", "name", "complaint"), READERS)
@pytest.mark.parametrize("content", [None, b"", b"\x80\x81\xfe\xff" * 20, 0.5, 0.999])
def test_a_file_that_cannot_be_read_is_named(tmp_path, read, name, complaint, content):
    """It is missing, holds something else, or is cut off at a share of its length."""
    path = tmp_path / name
    if content is None:
        complaint = "no such file; run the stage"
    elif isinstance(content, bytes):
        path.write_bytes(content)
    else:
        WRITERS[name](path)
        size = path.stat().st_size
        path.write_bytes(path.read_bytes()[: min(int(content * size), size - 3)])
    with pytest.raises(InputError, match=re.escape(f"{path}: {complaint}")):
        read(path)


def test_metrics_are_flat_rounded_and_readable(tmp_path):
    path = tmp_path / "m.json"
    metrics = {
        "error": 1 / 3,
        "tiny": np.float32(1.23456789e-9),
        "runs": np.int64(7),
        "ok": True,
        "none": None,
    }
    artefacts.write_metrics({**metrics, "text": "joint"}, path)
    expected = {"error": 0.333333, "tiny": 1.23457e-9, "runs": 7, "ok": True, "none": None, "text": "joint"}
    assert artefacts.read_metrics(path) == expected
    assert list(json.loads(path.read_text())) == list(expected)  # the order is the caller's
    for value in (float("inf"), np.float32("nan")):
        with pytest.raises(ValueError, match=f"metric 'error' is {value}"):
            artefacts.write_metrics({"error": value}, path)
    assert artefacts.read_metrics(path) == expected
    artefacts.write_csv(pd.DataFrame({"a": [1 / 3, 2.0], "b": ["x", "y"]}), tmp_path / "t.csv")
    assert (tmp_path / "t.csv").read_bytes() == b"a,b\n0.333333,x\n2,y\n"
    for text, words in (
        ("[" * 100_000, "not a JSON file: maximum recursion depth"),
        ('{"runs": ' + "9" * 6000 + "}", "not a JSON file: Exceeds the limit"),
        ("[1, 2]", "not a JSON file of names and values"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=re.escape(f"{path}: {words}")):
            artefacts.read_metrics(path)


def test_two_processes_never_publish_one_target(tmp_path):
    target = tmp_path / "logs"
    with artefacts.publish(target) as path:
        path.mkdir()
        (path / "first").write_text("first")
        with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as pool:
            complaint = pool.submit(_publish, target).result()
    assert complaint == f"{target}: another process is writing it"
    assert [entry.name for entry in target.iterdir()] == ["first"]
    assert _publish(target) is None
    assert list(tmp_path.iterdir()) == [target]


def _publish(target):
    """Publish another folder; what is complained of."""
    try:
        with artefacts.publish(target) as path:
            path.mkdir()
    except InputError as error:
        return str(error)


def test_a_killed_process_does_not_hold_what_its_children_outlive(tmp_path):
    """A pool forked while something is published inherits open files; the lock is not among them."""
    target = tmp_path / "logs"
    program = f"""
import os, signal, sys, time
from structlearn.core.artefacts import publish
with publish({str(target)!r}) as path:
    path.mkdir()
    if not os.fork():
        os.close(1)
        time.sleep(20)
        os._exit(0)
    os.kill(os.getpid(), signal.SIGKILL)
"""
    subprocess.run([sys.executable, "-c", program], stdout=subprocess.PIPE, check=False)
    assert _publish(target) is None
    assert target.is_dir()
