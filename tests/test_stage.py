import os
import resource
import runpy
import subprocess
import sys
import time

import pytest

from structlearn.core import stage
from structlearn.core.errors import InputError, MissingInputError


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (InputError("log.mcap: topic '/tool' is missing"), 1, "error: log.mcap: topic '/tool' is missing\n"),
        (KeyboardInterrupt(), 130, "error: interrupted; run it again\n"),
    ],
)
def test_bad_input_and_an_interruption_are_one_line_on_standard_error(capsys, error, code, said):
    def main():
        raise error

    with pytest.raises(SystemExit) as exit_:
        stage.run(main)
    assert exit_.value.code == code
    assert capsys.readouterr() == ("", said)
    error = ValueError("a bug")
    with pytest.raises(ValueError, match="a bug"):  # with its traceback
        stage.run(main)
    stage.run(lambda: None)
    assert capsys.readouterr() == ("", "")


def test_a_stage_without_its_data_leaves_an_empty_folder_and_says_why(tmp_path, capsys):
    """Damaged data are an error and leave what was there."""
    (tmp_path / "old.txt").write_text("of data that are gone")

    def read(error):
        raise error

    with pytest.raises(InputError, match="cut off"):
        stage.or_empty(lambda: read(InputError("cut off")), tmp_path)()
    assert len(list(tmp_path.iterdir())) == 1
    stage.or_empty(lambda: read(MissingInputError("data: holds no logs")), tmp_path)()
    assert list(tmp_path.iterdir()) == []
    assert capsys.readouterr().out == f"{tmp_path}: left empty: data: holds no logs\n"


HOLD = """
import sys, time
from pathlib import Path
from structlearn.core.stage import run

def main():
    Path("begun").touch()
    while not Path("done").exists():
        time.sleep(0.01)

run(main)
"""


def test_a_stage_runs_once_at_a_time_for_each_task(tmp_path):
    """Each of its outputs is whole in any case, but those of two runs do not belong together."""
    (tmp_path / "hold.py").write_text(HOLD)
    command = [sys.executable, "hold.py", "pick"]
    with subprocess.Popen(command, cwd=tmp_path) as first:
        while not (tmp_path / "begun").exists():
            time.sleep(0.01)
        second = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        (tmp_path / "done").touch()
        assert subprocess.run([*command[:-1], "pour"], cwd=tmp_path).returncode == 0
        assert first.wait() == 0
    assert second.returncode == 1
    assert second.stderr == "error: hold.py: another process is running this stage\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["begun", "done", "hold.py"]


def test_a_disk_without_room_for_compiled_code_is_one_line(tmp_path):
    script = "import structlearn.core.stage, numba; numba.cfunc('f8(f8)', cache=True)(lambda x: x)"
    (tmp_path / "script.py").write_text(script)
    ended = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, check=False,
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "kept")},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100)),
    )  # fmt: skip
    assert (ended.returncode, ended.stderr) == (1, "error: a file: File too large\n")


@pytest.mark.parametrize("words", [[], ["none"], ["none", "segment"]])
def test_a_script_that_takes_words_says_which(root, monkeypatch, capsys, words):
    script = "stages/studies/cell.py"
    monkeypatch.chdir(root)
    monkeypatch.setattr(sys, "argv", [script, *words])
    with pytest.raises(SystemExit) as exit_:
        runpy.run_path(script, run_name="__main__")
    assert exit_.value.code == 1
    assert capsys.readouterr().err.startswith(f"error: {script}: ")
