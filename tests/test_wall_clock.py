import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

from structlearn.core.parallel import BACKEND
from structlearn.core.stage import RUN_BY_DVC, TIMES, StageTime, main, read_times, record

STAGE = """
import sys, time
from structlearn.core.parallel import parallel_map
from structlearn.core.stage import run

def work(seconds):
    while time.process_time() < seconds:
        pass

def main():
    parallel_map(work, [float(word) for word in sys.argv[1:]], "work")
    if len(sys.argv) == 1:
        raise ValueError("a bug")

if __name__ == "__main__":
    run(main)
"""


def run_stage(folder, *words, **variables):
    (folder / "stage.py").write_text(STAGE)
    unset = {name: value for name, value in os.environ.items() if name not in (RUN_BY_DVC, BACKEND)}
    command = [sys.executable, "stage.py", *words]
    return subprocess.run(command, cwd=folder, env=unset | variables, capture_output=True, text=True)


def test_a_stage_of_dvc_leaves_its_time_with_that_of_its_workers_if_it_succeeds(tmp_path):
    """Every process works until it has used so many seconds, so no less can be counted."""
    assert run_stage(tmp_path, "0").returncode == 0  # by hand
    assert run_stage(tmp_path, **{RUN_BY_DVC: "stage"}).returncode == 1
    assert not (tmp_path / "reports").exists()
    done = run_stage(tmp_path, "1.2", "1", **{RUN_BY_DVC: "some/dvc.yaml:stage"})
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    ((command, taken),) = read_times(tmp_path / TIMES).items()
    assert command == "stage.py 1.2 1"
    assert taken.cpu_s >= 1.2
    assert taken.wall_s >= 1.0


def test_stages_that_end_at_once_lose_no_time(tmp_path):
    commands = [f"stages/{number}.py" for number in range(20)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda command: record(command, StageTime(1.0, 1.0), tmp_path / TIMES), commands))
    assert set(read_times(tmp_path / TIMES)) == set(commands)


def test_times_are_kept_by_command_the_last_one_counts(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / TIMES
    for content in (b"", b'{"a": ', b"\xff\xfe", b"[1]", b'{"a": 1}', b'{"a": [null, 1]}'):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)  # a damaged file is started anew
        assert read_times(path) == {}
    record("stages/b.py", StageTime(3.0, 4.0))
    record("stages/a.py", StageTime(1.26, 0.04))
    record("stages/b.py", StageTime(5.0, 6.0))
    assert read_times(path) == {"stages/a.py": StageTime(1.3, 0.0), "stages/b.py": StageTime(5.0, 6.0)}
    assert list(json.loads(path.read_text())) == ["stages/a.py", "stages/b.py"]
    assert list(path.parent.iterdir()) == [path]
    main()
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [*lines[-3:-1], lines[-1][:4]] == [
        ["5.0", "6.0", "stages/b.py"],
        ["1.3", "0.0", "stages/a.py"],
        ["6.3", "6.0", "2", "stages"],
    ]
    record("stages/a.py", StageTime(1.0, 2.0), path / "below a file")
    assert "the time of stages/a.py is not written" in capsys.readouterr().err
