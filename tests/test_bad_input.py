"""Bad input to a stage: one clear line on standard error, exit code 1, nothing half-written."""

import runpy
from pathlib import Path

import numpy as np
import pytest
import yaml
from recordings_bags import header, pose_messages, pose_rows, write_bag

from structlearn.recordings import write_recordings
from structlearn.simulation.demonstrator import DemonstratorParameters, simulate_demonstrations

TOPIC = "/tool"


@pytest.fixture
def project(root, tmp_path, monkeypatch) -> Path:
    """An empty project with the real parameters; its demonstrations come from `bags`."""
    parameters = yaml.safe_load((root / "params.yaml").read_text())
    parameters["record"] = {"source": "bags", "topics": {"pose": TOPIC}}
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(parameters))
    (tmp_path / "bags").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def change_parameters(project: Path, key: str, **values) -> None:
    parameters = yaml.safe_load((project / "params.yaml").read_text())
    parameters[key].update(values)
    (project / "params.yaml").write_text(yaml.safe_dump(parameters))


def complaint(root: Path, stage: str, capsys) -> str:
    """What a stage says when it fails, after checking that it left nothing behind."""
    before = sorted(Path().rglob("*"))
    with pytest.raises(SystemExit) as exit_:
        runpy.run_path(str(root / "stages" / stage), run_name="__main__")
    assert exit_.value.code == 1
    left = [path for path in Path().rglob("*") if path not in before and not path.is_dir()]
    assert left == []
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error:")]
    assert len(lines) == 1
    return lines[0]


def clock(count: int = 400) -> np.ndarray:
    return 10**9 + np.arange(count) * 3_333_333


def test_truncated_file(root, project, capsys):
    write_bag("bags/one.mcap", pose_messages(clock(), pose_rows(400), TOPIC))
    whole = Path("bags/one.mcap").read_bytes()
    Path("bags/one.mcap").write_bytes(whole[: len(whole) // 2])
    assert "bags/one.mcap" in complaint(root, "scraping/record.py", capsys)


def test_unknown_message_type(root, project, capsys):
    write_bag("bags/one.mcap", [(TOPIC, "std_msgs/msg/String", {"data": "x"}, s) for s in (1, 2)])
    message = complaint(root, "scraping/record.py", capsys)
    assert "bags/one.mcap" in message
    assert TOPIC in message
    assert "String" in message


def test_missing_topic(root, project, capsys):
    write_bag("bags/one.mcap", pose_messages(clock(), pose_rows(400), "/other"))
    message = complaint(root, "scraping/record.py", capsys)
    assert TOPIC in message
    assert "/other" in message  # what the file does have


def test_empty_recording(root, project, capsys):
    write_bag("bags/one.mcap", [], empty=[(TOPIC, "geometry_msgs/msg/PoseStamped")])
    assert TOPIC in complaint(root, "scraping/record.py", capsys)


def test_empty_folder(root, project, capsys):
    assert "holds no .mcap file" in complaint(root, "scraping/record.py", capsys)


def spoiled(change) -> tuple[np.ndarray, np.ndarray]:
    stamps, rows = clock(), pose_rows(400)
    change(stamps, rows)
    return stamps, rows


def set_row(stamps, rows, row, **values):
    if "stamp" in values:
        stamps[row] = values["stamp"]
    if "pose" in values:
        rows[row] = values["pose"]


FAULTS = {
    "nan": (lambda s, r: set_row(s, r, 7, pose=np.full(7, np.nan)), ["row 7"]),
    "clock back": (lambda s, r: set_row(s, r, 20, stamp=s[18]), ["row 20"]),
    "duplicate": (lambda s, r: set_row(s, r, 20, stamp=s[19]), ["row 20"]),
    "norm": (lambda s, r: set_row(s, r, 5, pose=1.5 * r[5]), ["row 5", "norm"]),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faulty_samples(root, project, capsys, fault):
    change, words = FAULTS[fault]
    messages = pose_messages(*spoiled(change), TOPIC)
    logged = zip(messages, clock().tolist(), strict=True)  # the recorder's own clock is sound
    write_bag("bags/one.mcap", [(*message[:3], log_time) for message, log_time in logged])
    message = complaint(root, "scraping/record.py", capsys)
    for word in ["bags/one.mcap", *words]:
        assert word in message


def test_one_sample(root, project, capsys):
    write_bag("bags/one.mcap", pose_messages(clock(1), pose_rows(1), TOPIC))
    message = complaint(root, "scraping/record.py", capsys)
    assert "one" in message
    assert "sample" in message


def test_gap(root, project, capsys):
    stamps, rows = clock(), pose_rows(400)
    stamps[200:] += 10**9
    write_bag("bags/one.mcap", pose_messages(stamps, rows, TOPIC))
    runpy.run_path(str(root / "stages/scraping/record.py"), run_name="__main__")
    message = complaint(root, "scraping/segment.py", capsys)
    assert "gap" in message
    assert "row 199" in message


def test_too_few_crossings(root, project, capsys):
    still = np.tile(pose_rows(1), (400, 1))
    write_bag("bags/one.mcap", pose_messages(clock(), still, TOPIC))
    runpy.run_path(str(root / "stages/scraping/record.py"), run_name="__main__")
    message = complaint(root, "scraping/segment.py", capsys)
    assert "one: primitive 'down': its speed never exceeds" in message


@pytest.mark.parametrize(
    ("key", "values", "words"),
    [
        ("segment", {"extention_s": 0.2}, "segment.extention_s: unknown parameter"),
        ("segment", {"extension_s": -1.0}, "segment.extension_s: Input should be greater than 0 (got -1.0)"),
        ("segment", {"downsampling": 1.5}, "segment.downsampling"),
        ("clock", {"rate_hz": float("nan")}, "clock.rate_hz"),
    ],
)
def test_parameters(root, project, capsys, key, values, words):
    change_parameters(project, key, **values)
    assert words in complaint(root, "scraping/segment.py", capsys)


def test_wrong_column_count_in_a_text_log(root, project, capsys, monkeypatch):
    folder = project / "public" / "clmc" / "cart_coord_dmp" / "dataset1"
    folder.mkdir(parents=True)
    (folder / "1.txt").write_text("0 1 2 3 4 5 6 7 8 9\n0.001 1 2 3\n")
    monkeypatch.setenv("RECORDED_DATA", str(project / "public"))
    message = complaint(root, "recorded/import_recordings.py", capsys)
    assert "1.txt" in message
    assert "line 2" in message


def test_missing_public_recordings(root, project, capsys, monkeypatch):
    monkeypatch.setenv("RECORDED_DATA", str(project / "nowhere"))
    assert "nowhere" in complaint(root, "recorded/import_recordings.py", capsys)


def test_missing_artefact_of_an_earlier_stage(root, project, capsys):
    write_recordings(
        simulate_demonstrations(DemonstratorParameters(count=2), touch=False), "data/raw/scraping/nominal"
    )
    message = complaint(root, "scraping/fit_primitives.py", capsys)
    assert "data/segments/scraping/cuts.parquet: no such file" in message


def test_a_bag_with_header_stamps_is_taken_over(root, project):
    """The counterpart: good bags of a user's own pass through record, segment and fit."""
    demonstrations = simulate_demonstrations(DemonstratorParameters(count=3, noise_mm=0.1), touch=False)
    for recording in demonstrations:
        pose = recording.streams[0]
        messages = pose_messages(pose.stamps.tolist(), pose.values, TOPIC)
        assert messages[0][2]["header"] == header(int(pose.stamps[0]))
        write_bag(f"bags/{recording.name}.mcap", messages)
    for stage in ("record", "segment", "fit_primitives"):
        runpy.run_path(str(root / "stages" / "scraping" / f"{stage}.py"), run_name="__main__")
    assert Path("data/primitives/scraping/primitives.safetensors").is_file()
