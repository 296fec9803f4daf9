import yaml

from structlearn.ground.wall_clock import StageTime, record
from structlearn.reporting import stage_times as reported
from structlearn.reporting.stage_times import PIPELINES, stage_times, this_machine, times_page

MAIN = {
    "stages": {
        "segment": {"cmd": "python stages/scraping/segment.py"},
        "refine": {"cmd": "python stages/scraping/refine.py"},
        "overview": {"cmd": "python stages/report.py"},
    }
}
RECORDED = {"stages": {"segment": {"cmd": "python stages/recorded/segment.py"}}}
BOTH = dict(zip(PIPELINES, (MAIN, RECORDED), strict=True))
TIMES_TAKEN = {
    "stages/recorded/segment.py": StageTime(7.0, 9.0),
    "stages/scraping/segment.py": StageTime(102.0, 193.0),
    "stages/scraping/gone.py": StageTime(1e6, 1e6),
    "stages/report.py": StageTime(0.2, 0.1),
}
NONE = "\N{EN DASH}"


def cells(html):
    """Rows of the table of stages, and whether they are bold."""
    body = html.split("<tbody>")[1].split("</tbody>")[0]
    return [
        ('class="strong"' in row, [cell.split("</td>")[0].split(">")[1] for cell in row.split("<td")[1:]])
        for row in body.split("<tr")[1:]
    ]


def test_stages_are_in_the_order_of_the_pipelines_with_their_totals():
    html = times_page(stage_times(BOTH, TIMES_TAKEN), "two cores")
    main, recorded = PIPELINES
    assert cells(html) == [
        (False, [main, "segment", "102.0", "193.0"]),
        (False, [main, "refine", NONE, NONE]),
        (False, [main, "overview", "0.2", "0.1"]),
        (True, [main, "3 stages", "102.2", "193.1"]),
        (False, [recorded, "segment", "7.0", "9.0"]),
        (True, [recorded, "1 stage", "7.0", "9.0"]),
    ]
    assert "1 of 4 stages have no time" in html
    assert "1.8 min of wall time" in html
    assert "two cores" in html


def test_no_stage_has_a_time_yet():
    html = times_page(stage_times(BOTH, {}), "two cores")
    assert "4 of 4 stages have no time" in html
    assert all(row[2:] == [NONE] * 2 for _, row in cells(html))


def test_the_machine_is_named():
    assert "core" in this_machine()
    assert "Python 3." in this_machine()


def test_the_page_lies_beside_the_times(tmp_path, monkeypatch):
    for name, pipeline in BOTH.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(yaml.safe_dump(pipeline, sort_keys=False))
    monkeypatch.chdir(tmp_path)
    reported.main()
    record("stages/report.py", StageTime(12.3, 4.5))
    reported.main()
    assert ">12.3<" in (tmp_path / "reports/times/index.html").read_text()
    assert 'href="../index.html"' in (tmp_path / "reports/times/index.html").read_text()


def test_every_stage_runs_a_script_of_its_own(root):
    """Times are kept by the command, so no two stages share one."""
    stages = [yaml.safe_load((root / name).read_text())["stages"] for name in PIPELINES]
    commands = [stage["cmd"] for group in stages for stage in group.values()]
    assert len(set(commands)) == len(commands)
    assert all(command.startswith("python stages/") for command in commands)
