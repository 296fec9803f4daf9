"""Touches of one's own skin: a made-up plate whose channels are bumps, pressed everywhere at some depths."""

import numpy as np
import pandas as pd
import pytest
import yaml
from committed import NO_TOPICS, TASK_FILE, merged

from structlearn.core.errors import InputError
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.touch_log import TouchLog, read_touch_table, touch_of, touch_tables
from structlearn.tasks.touch.learning import learn_touch
from structlearn.tasks.touch.parameters import TouchParameters
from structlearn.tasks.touch.skin_touches import gathered

CHANNELS_MM = tuple((x, y) for x in (0.0, 10.0, 20.0) for y in (0.0, 10.0, 20.0))
AIR = 20


def chosen(**changes) -> TouchParameters:
    """The defaults for a task's touches, quicker."""
    own = yaml.load(TASK_FILE.read_text(), yaml.CSafeLoader)["defaults"]["touch"]
    own |= {"source": "touches", "topics": NO_TOPICS | {"pose": "/probe"}, "channels_mm": CHANNELS_MM}
    own |= {"change": "rises", "air_samples": AIR, "touched": 5.0, "most_samples": 1500, "rival_samples": 100}
    own |= {"geodesics": {"neighbours": 12, "bin_size": 500, "bins": 2, "bridge_mm": 3.0, "seed": 0}}
    quick = {"spaces": {"seeds": 1, "pair_pool": 20000, "evaluation_pairs": 4000, "training": {"steps": 500}}}
    return TouchParameters.model_validate(merged(own, quick | changes))


def made_up(name: str, seed: int, count: int = 700) -> TouchLog:
    """Air, then touches all over the plate; resting readings are not zero."""
    rng = np.random.default_rng(seed)
    place = rng.uniform(0.0, 20.0, (count, 2))
    depth = rng.uniform(0.3, 1.0, count)
    away = np.linalg.norm(place[:, None] - np.array(CHANNELS_MM), axis=-1)
    counts = 100.0 * depth[:, None] * np.exp(-0.5 * (away / 8.0) ** 2)
    counts = np.vstack([np.zeros((AIR, len(CHANNELS_MM))), counts])
    counts += 300.0 + 0.2 * rng.standard_normal(counts.shape)
    where = np.vstack([np.full((AIR, 3), 0.05), np.column_stack([1e-3 * place, -1e-3 * depth])])
    return TouchLog(name, tuple(f"c{place}" for place in range(counts.shape[1])), counts, where)


def test_air_reads_zero_and_is_no_touch():
    (touches,), recordings = gathered([made_up("a", 0)], chosen())
    assert recordings.to_dict("records") == [{"recording": "a", "samples": 720, "touching": 700}]
    assert touches.counts.min() > -2.0
    assert len(gathered([made_up("a", 0)], chosen(most_samples=100))[0][0].counts) == 100


def test_places_follow_from_channels_where_nobody_knows_them():
    log = made_up("a", 0)
    unknown = TouchLog("a", log.channels, log.counts, None)
    (touches,), _ = gathered([unknown], chosen(places="channels"))
    assert touches.along is not None
    quick = {"seeds": 1, "pair_pool": 2000, "evaluation_pairs": 500, "training": {"steps": 20}}
    errors = learn_touch([unknown], chosen(places="channels", folds=2, spaces=quick))[1]["errors"]
    assert errors.groupby("model")["map_nmse"].mean().notna().all()
    correlation = [np.corrcoef(touches.place[:, axis], log.place[AIR:, axis])[0, 1] for axis in range(2)]
    assert min(correlation) > 0.95


def test_a_table_says_what_is_wrong_with_it(tmp_path):
    log = made_up("a", 0, 5)
    frame = pd.DataFrame(log.counts, columns=log.channels).assign(time_s=0.1)
    frame[["x_m", "y_m", "z_m"]] = log.place
    frame.to_csv(tmp_path / "a 10.csv", index=False)
    frame.to_parquet(tmp_path / "a 2.parquet")
    assert [path.stem for path in touch_tables(tmp_path)] == ["a 2", "a 10"]
    for path in touch_tables(tmp_path):
        (read,) = read_touch_table(path, None)
        assert read.channels == log.channels
        np.testing.assert_allclose(read.counts, log.counts)
        np.testing.assert_allclose(read.place, log.place)
    assert read_touch_table(tmp_path / "a 10.csv", ["c3"])[0].counts.shape == (25, 1)
    several = frame.assign(run=["x", "y"] * 12 + ["x"], force_n=np.nan)
    several.to_csv(tmp_path / "several.csv", index=False)
    x, y = read_touch_table(tmp_path / "several.csv", None)
    assert (x.name, y.name, x.channels, len(x.counts)) == ("x", "y", log.channels, 13)
    assert np.isnan(y.force).all()
    assert y.time.tolist() == [0.1] * 12
    frame.drop(columns="y_m").to_csv(tmp_path / "b.csv", index=False)
    frame.assign(c1="soft").to_csv(tmp_path / "c.csv", index=False)
    (tmp_path / "d.parquet").write_text("none")
    for name, channels, message in (
        ("a 10.csv", ["other"], r"a 10\.csv: has no column other; its columns are c0, "),
        ("b.csv", None, r"b\.csv: has no column y_m, but the other one of the place"),
        ("c.csv", None, r"c\.csv: row 0, column c1: is not a finite number: soft"),
        ("d.parquet", None, r"d\.parquet: not a Parquet file"),
    ):
        with pytest.raises(InputError, match=message):
            read_touch_table(tmp_path / name, channels)
    with pytest.raises(InputError, match=r"nowhere: no such file or folder$"):
        touch_tables(tmp_path / "nowhere")


def test_what_cannot_be_learned_from_is_refused():
    log = made_up("a", 0)
    bare = TouchLog("a", log.channels, log.counts, None)
    other = TouchLog("b", ("x",), log.counts[:, :1], log.place)
    for logs, changes, message in (
        ([bare], {}, r"^a: has no columns x_m and y_m"),
        (
            [bare],
            {"places": "channels", "channels_mm": None},
            r"^a: channels_mm names 0 places of 9 channels",
        ),
        ([log], {"touched": 1000.0}, r"^touches: nothing touches: no pressure reaches 1000"),
        ([log, other], {}, r"^b: its channels \(x\) are not those of a"),
    ):
        with pytest.raises(InputError, match=message):
            gathered(logs, chosen(**changes))
    still = Demonstration("run", np.arange(3.0), np.zeros((3, 3)))
    with pytest.raises(InputError, match=r"^run: has no tactile signal"):
        touch_of(still)
