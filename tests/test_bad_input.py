"""Bad input to a stage: one clear line on standard error, exit code 1, nothing half-written."""

import runpy
from pathlib import Path

import numpy as np
import pytest
import yaml
from committed import NO_TOPICS, committed
from feedback_toy import toy_dataset
from recordings_bags import header, pose_messages, pose_rows, write_bag
from scraping_motions import CHANNELS, NAMES, constant_network, scraping_skill

from structlearn.feedback.coupling_dataset import to_table
from structlearn.feedback.feedback_models import MODELS
from structlearn.feedback.pmnn import read_networks, write_networks
from structlearn.ground.artefacts import write_table
from structlearn.primitives.primitive_files import write_primitives, write_vector_primitive
from structlearn.recordings import write_recordings
from structlearn.testbeds.scraping.world.demonstrator import DemonstratorParameters, simulate_demonstrations

TOPIC = "/tool"


@pytest.fixture
def project(root, tmp_path, monkeypatch) -> Path:
    """An empty project with the real parameters; its demonstrations come from `bags`."""
    parameters = yaml.safe_load((root / "params.yaml").read_text())
    parameters["record"] = {"source": "bags", "topics": {"pose": TOPIC} | NO_TOPICS}
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(parameters))
    (tmp_path / "bags").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def change_parameters(project: Path, key: str, **values) -> None:
    parameters = yaml.safe_load((project / "params.yaml").read_text())
    parameters[key].update(values)
    (project / "params.yaml").write_text(yaml.safe_dump(parameters))


def contents() -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}


def complaint(root: Path, stage: str, capsys) -> str:
    """What a stage says when it fails, after checking that it left everything as it was."""
    before = contents()
    with pytest.raises(SystemExit) as exit_:
        runpy.run_path(str(root / "stages" / stage), run_name="__main__")
    assert exit_.value.code == 1
    assert contents() == before
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error:")]
    assert len(lines) == 1
    return lines[0]


def clock(count: int = 400) -> np.ndarray:
    return 10**9 + np.arange(count) * 3_333_333


def test_truncated_file(root, project, capsys):
    write_bag("bags/one.mcap", pose_messages(clock(), pose_rows(400), TOPIC))
    whole = Path("bags/one.mcap").read_bytes()
    Path("bags/one.mcap").write_bytes(whole[: len(whole) // 2])
    assert "bags/one.mcap" in complaint(root, "scraping/record_nominal.py", capsys)


def test_unknown_message_type(root, project, capsys):
    write_bag("bags/one.mcap", [(TOPIC, "std_msgs/msg/String", {"data": "x"}, s) for s in (1, 2)])
    message = complaint(root, "scraping/record_nominal.py", capsys)
    assert "bags/one.mcap" in message
    assert TOPIC in message
    assert "String" in message


def test_missing_topic(root, project, capsys):
    write_bag("bags/one.mcap", pose_messages(clock(), pose_rows(400), "/other"))
    message = complaint(root, "scraping/record_nominal.py", capsys)
    assert TOPIC in message
    assert "/other" in message  # what the file does have


def test_empty_recording(root, project, capsys):
    write_bag("bags/one.mcap", [], empty=[(TOPIC, "geometry_msgs/msg/PoseStamped")])
    assert TOPIC in complaint(root, "scraping/record_nominal.py", capsys)


def test_empty_folder(root, project, capsys):
    assert "holds no .mcap file" in complaint(root, "scraping/record_nominal.py", capsys)


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
    message = complaint(root, "scraping/record_nominal.py", capsys)
    for word in ["bags/one.mcap", *words]:
        assert word in message


def test_one_sample(root, project, capsys):
    write_bag("bags/one.mcap", pose_messages(clock(1), pose_rows(1), TOPIC))
    message = complaint(root, "scraping/record_nominal.py", capsys)
    assert "one" in message
    assert "sample" in message


def test_gap(root, project, capsys):
    stamps, rows = clock(), pose_rows(400)
    stamps[200:] += 10**9
    write_bag("bags/one.mcap", pose_messages(stamps, rows, TOPIC))
    runpy.run_path(str(root / "stages/scraping/record_nominal.py"), run_name="__main__")
    message = complaint(root, "scraping/segment.py", capsys)
    assert "gap" in message
    assert "row 199" in message


def test_too_few_crossings(root, project, capsys):
    still = np.tile(pose_rows(1), (400, 1))
    write_bag("bags/one.mcap", pose_messages(clock(), still, TOPIC))
    runpy.run_path(str(root / "stages/scraping/record_nominal.py"), run_name="__main__")
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
        simulate_demonstrations(committed(DemonstratorParameters, "simulate", count=2)),
        "data/raw/scraping/nominal",
    )
    message = complaint(root, "scraping/fit_primitives.py", capsys)
    assert "data/segments/scraping/cuts.parquet: no such file" in message


def test_a_bag_with_header_stamps_is_taken_over(root, project):
    """The counterpart: good bags of a user's own pass through record, segment and fit."""
    demonstrations = simulate_demonstrations(
        committed(DemonstratorParameters, "simulate", count=3, noise_mm=0.1)
    )
    for recording in demonstrations:
        pose = recording.streams[0]
        messages = pose_messages(pose.stamps.tolist(), pose.values, TOPIC)
        assert messages[0][2]["header"] == header(int(pose.stamps[0]))
        write_bag(f"bags/{recording.name}.mcap", messages)
    for stage in ("record_nominal", "segment", "fit_primitives"):
        runpy.run_path(str(root / "stages" / "scraping" / f"{stage}.py"), run_name="__main__")
    assert Path("data/primitives/scraping/primitives.safetensors").is_file()


# The feedback stages: what earlier stages and the user's own runs may lack.

FINGERS = ["/fingers/left", "/fingers/right"]
DATA = Path("data/feedback/scraping")


@pytest.fixture
def feedback(project) -> Path:
    """Primitives, expected traces, a supervised set and networks, as the stages before have written them."""
    skill = scraping_skill()
    write_primitives(skill.primitives, "data/primitives/scraping/primitives.safetensors")
    for name, traces in skill.expected.items():
        write_vector_primitive(traces, DATA / f"expected/{name}.safetensors", "counts")
    samples = toy_dataset(settings=(2.5, 5.0, 7.5, 10.0), channels=CHANNELS)
    for name in NAMES[1:]:
        write_table(to_table(samples), DATA / f"dataset/{name}.parquet")
    for model in MODELS:
        write_networks(
            [(name, constant_network()) for name in NAMES[1:]], DATA / f"models/{model}.safetensors"
        )
    for output in ("comparison/scores.parquet", "evaluation/scores.parquet"):
        (DATA / output).parent.mkdir(parents=True, exist_ok=True)
        (DATA / output).write_text("of an earlier run")
    return project


def own_corrections(project: Path, settings, topics) -> None:
    """A user's corrected demonstrations: bags with a pose and nothing else."""
    change_parameters(project, "record", topics=NO_TOPICS | {"pose": TOPIC} | topics)
    change_parameters(project, "record_corrections", source="corrections", settings_deg=[2.5, 5])
    for setting in settings:
        folder = Path("corrections") / setting
        folder.mkdir(parents=True)
        write_bag(folder / "one.mcap", pose_messages(clock(), pose_rows(400), TOPIC))


def test_a_setting_that_the_user_has_no_folder_for(root, feedback, capsys):
    own_corrections(feedback, ["5"], {})
    message = complaint(root, "scraping/record_corrections.py", capsys)
    assert "corrections/2.5: no such file or folder" in message


def test_corrections_without_a_tactile_topic_that_was_named(root, feedback, capsys):
    own_corrections(feedback, ["2.5", "5"], {"tactile": FINGERS})
    message = complaint(root, "scraping/record_corrections.py", capsys)
    assert "corrections/2.5/one.mcap: has no topic '/fingers/left' for tactile" in message


def touchless(folder: str) -> None:
    write_recordings(simulate_demonstrations(committed(DemonstratorParameters, "simulate", count=1)), folder)


def test_corrections_without_touch(root, feedback, capsys):
    """Nobody named a tactile topic, so the bags were taken over: it is missed where it is needed."""
    touchless("data/raw/scraping/corrections/5")
    message = complaint(root, "scraping/coupling_dataset.py", capsys)
    assert message == "error: 01: has no tactile stream, which feedback is learned from"


def test_expected_traces_without_touch(root, feedback, capsys):
    write_bag("bags/one.mcap", pose_messages(clock(), pose_rows(400), TOPIC))
    change_parameters(feedback, "expected_traces", source="bags")
    touchless("data/raw/scraping/unrolls")
    change_parameters(feedback, "record", topics=NO_TOPICS | {"pose": TOPIC, "tactile": FINGERS})
    message = complaint(root, "scraping/expected_traces.py", capsys)
    assert "bags/one.mcap: has no topic '/fingers/left' for tactile" in message


def test_a_folder_beside_the_settings(root, feedback, capsys):
    touchless("data/raw/scraping/corrections/five")
    message = complaint(root, "scraping/coupling_dataset.py", capsys)
    assert "data/raw/scraping/corrections/five: a setting's folder has a number as its name" in message


def test_corrections_that_no_stage_has_written(root, feedback, capsys):
    message = complaint(root, "scraping/coupling_dataset.py", capsys)
    assert "data/raw/scraping/corrections: no such folder; run the stage that writes it" in message


@pytest.mark.parametrize("stage", ["train_feedback", "compare_models"])
def test_a_setting_to_learn_from_that_was_not_recorded(root, feedback, capsys, stage):
    change_parameters(feedback, "coupling_dataset", settings_deg=[5, 6.3])
    message = complaint(root, f"scraping/{stage}.py", capsys)
    assert "scrape.parquet: has no corrections in the settings 6.3" in message


@pytest.mark.parametrize("stage", ["train_feedback", "compare_models", "evaluate_feedback"])
def test_a_truncated_dataset(root, feedback, capsys, stage):
    file = DATA / "dataset/turn.parquet"
    file.write_bytes(file.read_bytes()[:1000])
    message = complaint(root, f"scraping/{stage}.py", capsys)
    assert f"{file}: not a readable Parquet file" in message


def spoil_networks(change) -> Path:
    file = DATA / "models/unrolled.safetensors"
    change(file)
    return file


def test_a_truncated_models_file(root, feedback, capsys):
    file = spoil_networks(lambda path: path.write_bytes(path.read_bytes()[:-100]))
    message = complaint(root, "scraping/evaluate_feedback.py", capsys)
    assert f"{file}: not a readable safetensors file" in message


def test_a_network_with_a_value_that_is_none(root, feedback, capsys):
    def poison(path: Path) -> None:
        networks = read_networks(path)
        networks["turn"].phase_weights[3, 1] = np.nan
        write_networks(list(networks.items()), path)

    file = spoil_networks(poison)
    message = complaint(root, "scraping/evaluate_feedback.py", capsys)
    assert f"{file}: turn.phase_weights holds a value that is not finite" in message


def test_a_missing_models_file(root, feedback, capsys):
    file = spoil_networks(Path.unlink)
    assert f"{file}: no such file; run" in complaint(root, "scraping/evaluate_feedback.py", capsys)


def test_networks_of_another_sensor(root, feedback, capsys):
    change_parameters(feedback, "record", source="simulated")
    three = constant_network(channels=3)
    spoil_networks(lambda path: write_networks([(name, three) for name in NAMES[1:]], path))
    change_parameters(feedback, "evaluate_feedback", settings_deg=[0], runs=1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STRUCTLEARN_BACKEND", "sequential")
        message = complaint(root, "scraping/evaluate_feedback.py", capsys)
    assert "the network of 'scrape' takes 3 channels, but its expected traces have 38" in message


@pytest.mark.parametrize(
    ("key", "values", "stage", "words"),
    [
        ("coupling_dataset", {"axis": [0, 0, 0]}, "coupling_dataset", "axis must have a direction"),
        ("coupling_dataset", {"rate_hz": 0}, "coupling_dataset", "coupling_dataset.rate_hz"),
        ("train_feedback", {"validation_share": 1.0}, "train_feedback", "train_feedback.validation_share"),
        ("train_feedback", {"pointwise": {"step": 3}}, "train_feedback", "pointwise.step: unknown parameter"),
        ("compare_models", {"dropout": 1.0}, "compare_models", "compare_models.dropout"),
        ("evaluate_feedback", {"runs": 0}, "evaluate_feedback", "evaluate_feedback.runs"),
        ("testbed", {"world": {"board_n_m": -1}}, "evaluate_feedback", "testbed.world.board_n_m"),
    ],
)
def test_parameters_of_the_feedback_stages(root, feedback, capsys, key, values, stage, words):
    change_parameters(feedback, key, **values)
    assert words in complaint(root, f"scraping/{stage}.py", capsys)
