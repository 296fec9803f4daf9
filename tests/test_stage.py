import subprocess
import sys

import pytest

from structlearn.ground import stage
from structlearn.ground.errors import InputError
from structlearn.ground.params import Parameters


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
        "from structlearn.ground import stage\n"
        "from structlearn.ground.params import Parameters\n"
        "stage.run(lambda: stage.stage_parameters('fit', Parameters))\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr == "error: params.yaml: no such parameter file\n"
