import yaml

from structlearn.ground.wall_clock import StageTime, record
from structlearn.reporting import stage_times as reported
from structlearn.reporting.stage_times import OVERVIEW, PIPELINES, stage_times, this_machine, times_page

MAIN = {
    "stages": {
        "segment": {"cmd": "python stages/scraping/segment.py"},
        "refine": {"cmd": "python stages/scraping/refine.py"},
        "train": {"cmd": "python stages/obstacles/train.py"},
        "overview": {"cmd": "python stages/report.py"},
    }
}
RECORDED = {"stages": {"segment": {"cmd": "python stages/recorded/segment.py"}}}
TIMES_TAKEN = {
    "stages/recorded/segment.py": StageTime(7.0, 7.0, 7.0, 0.0, 7.0, 7.0, 7.0),
    "stages/obstacles/train.py": StageTime(100.0, 190.0, 20.0, 180.0, 65.0, 31.0, 30.0),
    "stages/scraping/segment.py": StageTime(2.0, 3.0, 1.0, 3.0, 1.8, 1.2, 1.0),
    "stages/scraping/gone.py": StageTime(*[1e6] * 7),
    "stages/report.py": StageTime(0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0),
}


def cells(html):
    """Rows of the table of stages, and whether they are bold."""
    body = html.split("<tbody>")[1].split("</tbody>")[0]
    return [
        ('class="strong"' in row, [cell.split("</td>")[0].split(">")[1] for cell in row.split("<td")[1:]])
        for row in body.split("<tr")[1:]
    ]


def test_stages_are_in_the_order_of_the_pipelines_with_sums_below_their_testbeds():
    html = times_page(stage_times([MAIN, RECORDED], TIMES_TAKEN), "two cores")
    none = "\N{EN DASH}"
    scraping = ["2.0", "3.0", "1.5", "25%", "1.8", "1.2", "1.0"]
    obstacles = ["100.0", "190.0", "1.9", "10%", "65.0", "31.0", "30.0"]
    overview = ["0.0", "0.1", none, none, "0.0", "0.0", "0.0"]
    recorded = ["7.0", "7.0", "1.0", "100%", "7.0", "7.0", "7.0"]
    assert cells(html) == [
        (False, ["scraping", "segment", *scraping]),
        (False, ["scraping", "refine", *[none] * 7]),
        (True, ["scraping", "2 stages", *scraping]),
        (False, ["obstacles", "train", *obstacles]),
        (True, ["obstacles", "1 stage", *obstacles]),
        (False, [OVERVIEW, "overview", *overview]),
        (True, [OVERVIEW, "1 stage", *overview]),
        (False, ["recorded", "segment", *recorded]),
        (True, ["recorded", "1 stage", *recorded]),
        (True, ["all", "5 stages", "109.0", "200.1", "1.8", "13%", "73.8", "39.2", "38.0"]),
    ]
    assert "1 of 5 stages have no time" in html
    assert "1.8 min of wall time" in html
    assert "two cores" in html


def test_no_stage_has_a_time_yet():
    html = times_page(stage_times([MAIN], {}), "two cores")
    assert "4 of 4 stages have no time" in html
    assert all(row[2:] == ["\N{EN DASH}"] * 7 for _, row in cells(html))


def test_the_machine_is_named():
    assert "core" in this_machine()
    assert "Python 3." in this_machine()


def test_the_page_lies_beside_the_times(tmp_path, monkeypatch):
    for name, pipeline in zip(PIPELINES, (MAIN, RECORDED), strict=True):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(yaml.safe_dump(pipeline, sort_keys=False))
    monkeypatch.chdir(tmp_path)
    reported.main()
    record("stages/report.py", StageTime(12.3, 4.5, 12.3, 0.0, 12.3, 12.3, 12.3))
    reported.main()
    assert ">12.3<" in (tmp_path / "reports/times/index.html").read_text()
    assert 'href="../index.html"' in (tmp_path / "reports/times/index.html").read_text()


def test_every_stage_runs_a_script_of_its_own(root):
    """Times are kept by the command, so no two stages share one."""
    stages = [yaml.safe_load((root / name).read_text())["stages"] for name in PIPELINES]
    commands = [stage["cmd"] for group in stages for stage in group.values()]
    assert len(set(commands)) == len(commands)
    assert all(command.startswith("python stages/") for command in commands)
