import hashlib
import os
import re
import shutil
import subprocess
import sys
from contextlib import chdir, redirect_stdout
from io import StringIO

import numpy as np
import pytest
import yaml

from structlearn.core.artefacts import write_metrics, write_tensors
from structlearn.verify import main

STAGE = """
stages:
  write:
    cmd: mkdir -p logs/deep && echo one > logs/1.txt && echo two > logs/deep/2.txt && echo three > note.txt
    outs: [logs, note.txt]
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A pipeline that DVC has run."""
    folder = tmp_path_factory.mktemp("project")
    (folder / "dvc.yaml").write_text(STAGE)
    program = "from dvc.repo import Repo; Repo.init(no_scm=True).reproduce()"
    subprocess.run([sys.executable, "-c", program], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return folder


def verified(folder, *arguments):
    """Exit code and all that the command prints."""
    with chdir(folder), redirect_stdout(StringIO()) as printed, pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["verify", *arguments])
        try:
            main()
        except SystemExit as ended:
            return 1, f"{printed.getvalue()}{ended.code}\n"
    return 0, printed.getvalue()


def test_what_dvc_wrote_is_as_it_was_written(project):
    done = subprocess.run([sys.executable, "-m", "structlearn.verify"], cwd=project, capture_output=True)
    assert (done.returncode, done.stdout) == (0, b"2 outputs: all are as they were written\n")
    (project / "note.txt").rename(project / "kept")
    assert verified(project) == (1, "error: note.txt: is not there; stage 'write' writes it\n")
    (project / "kept").rename(project / "note.txt")
    code, words = verified(project / "logs")
    assert (code, words[:42]) == (1, "error: dvc.lock: no such file; run this in")


@pytest.mark.parametrize(
    ("outs", "words"),
    [
        ({"write": "none"}, "has not been run here"),
        ({"write": "none", "report": "reports/page"}, "has not been run here"),  # as in every clone
        (
            {"import@pick": "note.txt", "import@pour": "none"},
            "1 of its 2 tasks or cells have not been run here",
        ),
    ],
)
def test_what_was_not_run_here_is_no_fault(project, outs, words):
    (project / "reports").mkdir()
    (project / "reports/page").touch()
    sound = hashlib.md5((project / "note.txt").read_bytes()).hexdigest()
    other = {name: {"outs": [{"path": path, "md5": sound}]} for name, path in outs.items()}
    (project / "stages/other").mkdir(parents=True)
    (project / "stages/other/dvc.lock").write_text(yaml.safe_dump({"stages": other}))
    code, said = verified(project)
    shutil.rmtree(project / "stages")
    shutil.rmtree(project / "reports")
    assert code == 0, said
    assert said.startswith(
        f"stages/other/dvc.yaml: {words}\n{2 + ('note.txt' in outs.values())} outputs: all"
    )


@pytest.mark.parametrize(("path", "out"), [("logs/deep/2.txt", "logs"), ("note.txt", "note.txt")])
def test_a_bit_that_changed_by_itself_is_seen(project, path, out):
    """Time and size stay, so DVC does not look."""
    file, state = project / path, (project / path).stat()
    sound = file.read_bytes()
    file.chmod(0o644)
    file.write_bytes(bytes([sound[0] ^ 1]) + sound[1:])
    os.utime(file, ns=(state.st_atime_ns, state.st_mtime_ns))
    try:
        code, words = verified(project)
    finally:
        file.write_bytes(sound)
    assert code == 1
    assert words.startswith(f"error: {out}: not as stage 'write' left it")


def test_single_files(tmp_path):
    write_tensors({"a": np.arange(3.0)}, tmp_path / "skill.safetensors", "test")
    assert verified(tmp_path, "skill.safetensors") == (0, "1 files: all are as they were written\n")
    write_metrics({"error": 0.1}, tmp_path / "metrics.json")
    code, words = verified(tmp_path, "metrics.json")
    assert (code, words.count("\n")) == (0, 1)
    assert "metrics.json: can be read; it carries no checksum" in words
    write_tensors({"workspace": np.zeros((2, 3))}, tmp_path / "none.safetensors", '{"reactive_skill": {}}')
    code, words = verified(tmp_path, "none.safetensors")  # its digest holds, but it is no skill
    assert code == 1
    assert "none.safetensors: a skill file of version None" in words
    content = bytearray((tmp_path / "skill.safetensors").read_bytes())
    content[-1] ^= 1
    (tmp_path / "skill.safetensors").write_bytes(content)
    code, words = verified(tmp_path, "skill.safetensors", "note.txt")
    assert code == 1
    assert "skill.safetensors: damaged" in words
    assert "note.txt: only .safetensors, .parquet, .json, .mcap can be told" in words


@pytest.mark.parametrize("lock", ["stages: [", "stages:\n  write: {outs: [{path: 3, md5: a}]}", "\x00"])
def test_a_damaged_lock_is_named(tmp_path, lock):
    (tmp_path / "dvc.lock").write_text(lock)
    code, words = verified(tmp_path)
    assert (code, words.count("\n")) == (1, 1)
    assert re.match(r"error: dvc\.lock: not a (lock|YAML) file", words)
