import os
import resource
import subprocess
import sys
import time

import pytest

from structlearn.core import stage
from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.params import Parameters


class FitParameters(Parameters):
    kernel_count: int


def test_parameters_come_from_the_working_directory(tmp_path, monkeypatch):
    (tmp_path / "params.yaml").write_text("fit: {kernel_count: 25}")
    monkeypatch.chdir(tmp_path)
    assert stage.stage_parameters("fit", FitParameters).kernel_count == 25


def test_bad_input_is_one_line_on_standard_error_and_exit_code_one(capsys):
    def main():
        raise InputError("log.mcap: topic '/tool' is missing")

    with pytest.raises(SystemExit) as exit_:
        stage.run(main)
    assert exit_.value.code == 1
    captured = capsys.readouterr()
    assert captured.err == "error: log.mcap: topic '/tool' is missing\n"
    assert captured.out == ""


def test_an_interruption_is_one_line(capsys):
    def main():
        raise KeyboardInterrupt

    with pytest.raises(SystemExit) as exit_:
        stage.run(main)
    assert exit_.value.code == 130
    assert capsys.readouterr().err == "error: interrupted; run it again\n"


def test_errors_of_the_program_keep_their_traceback():
    def main():
        raise ValueError("a bug")

    with pytest.raises(ValueError, match="a bug"):
        stage.run(main)


def test_success_is_silent(capsys):
    stage.run(lambda: None)
    assert capsys.readouterr() == ("", "")


def test_a_stage_script_without_its_parameters_says_so(tmp_path):
    script = (
        "from structlearn.core import stage\n"
        "from structlearn.core.params import Parameters\n"
        "stage.run(lambda: stage.stage_parameters('fit', Parameters))\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr == "error: params.yaml: no such parameter file\n"


def test_a_stage_without_its_data_leaves_an_empty_folder_and_says_why(tmp_path, capsys):
    data, target = tmp_path / "data", tmp_path / "made"
    data.mkdir()
    target.mkdir()
    (target / "old.txt").write_text("of data that are gone")

    def read():
        raise MissingInputError(f"{data}: holds no logs")

    stage.or_empty(read, target)()
    assert list(target.iterdir()) == []
    (said,) = capsys.readouterr().out.splitlines()
    assert said == f"{target}: left empty: {data}: holds no logs"


def test_damaged_data_are_an_error_and_leave_what_was_there(tmp_path):
    def damaged():
        raise InputError("cut off")

    (tmp_path / "old.txt").write_text("")
    with pytest.raises(InputError, match="cut off"):
        stage.or_empty(damaged, tmp_path)()
    assert len(list(tmp_path.iterdir())) == 1


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
