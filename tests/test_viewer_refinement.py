import numpy as np
import pandas as pd
import pytest
from rerun.chunk import RrdReader
from test_viewer import contents, view_names
from test_viewer_executions import PRIMITIVES, RATE_HZ, board_run, streams, traces

from structlearn.palette import GREEN
from structlearn.recordings import write_recordings
from structlearn.recordings.source import ClockParameters
from structlearn.testbeds.scraping.protocol.orientation_cost import nominal_orientation, orientation_cost
from structlearn.testbeds.scraping.recordings.refinement_recording import write_refinement
from structlearn.testbeds.scraping.recordings.search_recording import COSTLY, Search, cost_colours, searches
from structlearn.testbeds.scraping.recordings.shown_execution import execution
from structlearn.testbeds.scraping.recordings.shown_runs import read_refined_runs
from structlearn.viewer.diagram import Diagram, rounded_range, tick_step
from structlearn.viewer.rrd import rgba

LABELS = ("without feedback", "before refinement", "after refinement")
CLOCK = ClockParameters(rate_hz=RATE_HZ, max_gap_s=0.2)
LENGTH = 40  # samples of a rollout, at 100 Hz


def executions(board_deg=10.0):
    """The tool lies the flatter the more feedback there is."""
    return [
        execution(
            label,
            board_run(hand_deg=board_deg - off, tool_on_board_deg=-off),
            board_deg,
            PRIMITIVES,
            traces(coupling),
            cost=np.full(200, np.radians(off)),  # shorter than the run
        )
        for label, off, coupling in zip(LABELS, (board_deg, 4.0, 1.0), (0.0, 2.0, 3.0), strict=True)
    ]


def rollouts(primitives=("turn", "scrape"), iterations=2, samples=3, failed=()):
    """Constant coupling terms; `failed` has (primitive, iteration, kind, number)."""
    history, felt = [], []
    for primitive in primitives:
        for iteration in range(iterations + 1):
            kinds = {"sample": samples, "improved": 2} if iteration else {}
            for kind, count in (kinds | {"feedback": 2}).items():
                for number in range(count):
                    keys = {"primitive": primitive, "iteration": iteration, "kind": kind, "number": number}
                    bad = tuple(keys.values()) in failed
                    cost = 10.0 - iteration + number
                    history.append(keys | {"cost_rad": np.nan if bad else cost, "fault": "x" * bad})
                    if not bad:
                        columns = {"time_s": np.arange(LENGTH) / 100, "target": 10.0 * iteration + number}
                        felt.append(pd.DataFrame(columns | {"cost_rad": cost / LENGTH} | keys))
    return pd.DataFrame(history), pd.concat(felt, ignore_index=True)


def logged(path, entity, component):
    """Values of a component by iteration."""
    found = {}
    for chunk in RrdReader(path).stream().to_chunks():
        if chunk.entity_path == entity and not chunk.is_static:
            columns = chunk.to_record_batch().to_pydict()
            found |= dict(zip(columns["iteration"], columns[component], strict=True))
    return found


def test_runs_before_and_after_share_a_scene_and_the_search_has_a_time_line_of_its_own(tmp_path):
    path = tmp_path / "refinement.rrd"
    settings = {deg: executions(deg) for deg in (10.0, 5.0)}
    write_refinement(path, settings, *rollouts(), "Test")
    rows, entities, timelines = contents(path)
    assert timelines == {"time", "iteration"}
    samples = -(-len(settings[10.0][0].run.time) // 4)  # 50 Hz of 200
    for tab in ("10\\ degrees", "5\\ degrees"):
        after, before = (f"/{tab}/runs/{kind}\\ refinement" for kind in ("after", "before"))
        assert {f"{after}/board", f"{after}/path", f"{after}/hand/electrodes"} <= entities
        assert {f"{before}/hand/fingers", f"{before}/tool/body"} <= entities
        assert not {f"{before}/board", f"{before}/path", f"{before}/hand/electrodes"} & entities  # a shadow
        assert rows[f"{before}/hand"] == rows[f"{before}/tool"] == rows[f"{after}/tool"] == samples
        for label in LABELS:
            assert rows[f"/{tab}/cost/{label.replace(' ', chr(92) + ' ')}"] == 50  # of 200 costs at 200 Hz
        assert f"/{tab}/force/after\\ refinement" not in entities
    for name in ("turn", "scrape"):
        for column in ("target", "cost_rad"):
            drawn = f"/search/{name}/{column}"
            assert [rows[f"{drawn}/{kind}"] for kind in ("sample", "improved", "feedback")] == [2, 2, 3]
            assert rows[f"{drawn}/network\\ before"] == 2
        assert f"/search/{name}/costs/failed" not in entities
    names = view_names(path)
    assert "after refinement (pale: before refinement), board at 10 degrees (simulated)" in names
    assert all("(simulated)" in name for name in names if "every rollout" in name)
    assert "before refinement, board at 10 degrees (simulated)" not in names


def test_the_search_of_one_primitive_with_failures(tmp_path):
    path = tmp_path / "refinement.rrd"
    failed = [("turn", 1, "sample", 0), ("turn", 1, "improved", 1)]
    write_refinement(path, {10.0: executions()}, *rollouts(("turn",), failed=failed))
    _, entities, _ = contents(path)
    assert not any(name.startswith("/search/scrape") for name in entities)
    texts = logged(path, "/search/turn/costs/failed", "Points2D:labels")
    assert {at: list(labels or []) for at, labels in texts.items()} == {0: [], 1: ["2 failed"], 2: []}
    strips = logged(path, "/search/turn/target/sample", "LineStrips2D:strips")
    assert {at: len(curves) for at, curves in strips.items()} == {1: 2, 2: 3}
    means = logged(path, "/search/turn/costs/sample/mean", "Points2D:labels")
    assert means == {1: ["10.5"], 2: ["9.0"]}  # of the two and of the three that did not fail


def test_samples_are_coloured_by_cost_and_the_cheapest_lies_on_top(tmp_path):
    path = tmp_path / "refinement.rrd"
    history, samples = rollouts(("turn",), iterations=1)
    write_refinement(path, {10.0: executions()}, history, samples)
    (strips,) = logged(path, "/search/turn/target/sample", "LineStrips2D:strips").values()
    (colours,) = logged(path, "/search/turn/target/sample", "LineStrips2D:colors").values()
    heights = [strip[0][1] for strip in strips]
    assert heights == sorted(heights)  # downwards: number 2, which costs most, is the highest and drawn first
    (search,) = searches(history, samples)
    assert colours == cost_colours(np.array([11.0, 10.0, 9.0]), search.cost_range).tolist()
    assert colours[0] == rgba([COSTLY])[0]
    assert colours[-1] == rgba([GREEN])[0]


def test_a_refinement_that_ended_before_it_began(tmp_path):
    path = tmp_path / "refinement.rrd"
    write_refinement(path, {10.0: executions()}, *rollouts(iterations=0))
    rows, entities, _ = contents(path)
    assert rows["/search/turn/target/feedback"] == 1
    assert "/search/turn/target/sample" not in entities


def test_curves_of_rollouts_that_were_not_cut_alike():
    history, samples = rollouts(("turn",), iterations=1)
    kept = ~((samples["kind"] == "sample") & (samples["number"] == 1) & (samples["time_s"] > 0.2))
    curves = Search("turn", history, samples[kept]).curves(1, "sample", "target")
    assert curves.shape == (LENGTH, 3)
    assert curves[1].count() == 21
    assert curves[2].tolist() == [12.0] * LENGTH


def test_a_diagram_turns_values_into_places_from_its_upper_left_corner():
    diagram = Diagram((1.0, 3.0), (-10.0, 10.0), width=20.0, height=5.0)
    assert diagram.points(np.array([1.0, 2.0, 3.0]), np.array([10.0, 0.0, -10.0])).tolist() == [
        [0.0, 0.0],
        [10.0, 2.5],
        [20.0, 5.0],
    ]


@pytest.mark.parametrize(("low", "high", "step"), [(0.0, 6.0, 1.0), (0.0, 7.0, 2.0), (-20.0, 5.0, 5.0)])
def test_ticks_are_1_2_or_5_times_a_power_of_ten(low, high, step):
    assert tick_step(low, high) == pytest.approx(step)
    assert tick_step(low / 1000, high / 1000) == pytest.approx(step / 1000)


def test_ranges_hold_all_values_and_end_at_ticks():
    assert rounded_range(np.array([-97.0, 171.0])) == pytest.approx((-100.0, 200.0))
    assert rounded_range(np.array([3.0, 4.1]), least=0.0) == pytest.approx((0.0, 5.0))
    assert rounded_range(np.zeros(3)) == (0.0, 1.0)


def test_refined_runs_are_found_where_the_stages_wrote_them(tmp_path):
    raw, feedback = tmp_path / "raw", tmp_path / "feedback"
    write_recordings([streams(board_run(hand_deg=0.0))], raw / "unrolls")
    rolls = {"nominal": -9.0, "before": -4.0, "after": -1.0}
    for model, roll in rolls.items():
        for setting in ("5", "10") if model != "after" else ("10",):  # at 5 degrees not all were executed
            runs = [streams(board_run(name, tool_on_board_deg=roll)) for name in ("01", "02")]
            write_recordings(runs, raw / "refined" / model / setting)
    executed = pd.concat(
        table.assign(model=model, primitive="turn", setting_deg=setting, run=run, coupling=roll)
        for model, roll in rolls.items()
        for setting in (5.0, 10.0)
        for run in ("01", "02")
        for table in [traces()["turn"]]  # feedback in one primitive only
    )
    (feedback / "refined").mkdir(parents=True)
    executed.to_parquet(feedback / "refined" / "traces.parquet")

    runs = read_refined_runs(raw, feedback, PRIMITIVES, CLOCK)
    assert list(runs) == [10.0]
    assert [one.label for one in runs[10.0]] == list(LABELS)
    for one, roll in zip(runs[10.0], rolls.values(), strict=True):
        assert set(one.coupling) == {roll}
        assert one.cost == pytest.approx(np.radians(-roll), abs=1e-6)  # the nominal tool is flat
    after = runs[10.0][2]
    nominal = nominal_orientation([board_run(hand_deg=0.0)])
    assert after.cost == pytest.approx(orientation_cost(after.run, nominal), abs=1e-6)
    write_refinement(tmp_path / "refinement.rrd", runs, *rollouts(("turn",)))


def test_without_a_refinement_nothing_is_shown(tmp_path):
    (tmp_path / "refined").mkdir()  # as the stage leaves it where nobody corrected
    assert read_refined_runs(tmp_path, tmp_path, PRIMITIVES, CLOCK) == {}
