"""Public sets: one that is here, one that is not, and the page over both; the commands that make them."""

import re
import shutil
from pathlib import Path

import pandas as pd
import pytest
import yaml
from committed import ROOT, own_tasks
from test_own_demonstrations import QUICK, REACH, run_stages, write_reach

from dissertation.evidence.claims import claims_table
from dissertation.recorded.recorded_index import publish_index, reload_verdicts
from structlearn.core.errors import InputError
from structlearn.reporting.document import words_in_view
from structlearn.tasks.project import CLONE
from structlearn.tasks.task_entry import targets

LIKE = {"testbed": "scraping", "statement": "Cuts are found", "page": "index"}
CLAIM = {"statement": "Nearly all are cut", "source": "aim", "by": "ours", "evidence": "cuts_demonstrations"}
CLAIM |= {"test": "at least", "bound": 2, "format": ".0f", "note": "of {{ 3 if cuts is defined else 'all' }}"}
SETS = {
    "movement": {"moves": REACH | {"source": "$DATA/moves", "title": "Moves of a hand"}},
    "motion": {"arm": {"source": "$DATA/arm", "urdf": "$DATA/arm.urdf"}},
    "touch": {},
    "obstacles": {},
}


@pytest.fixture(scope="module")
def project(root, tmp_path_factory) -> Path:
    """All stages of both sets have run, of which one is not here."""
    folder = tmp_path_factory.mktemp("public")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("RECORDED_DATA", "sets")
        own_tasks(folder, QUICK)
        Path("stages/tasks/public.yaml").write_text(yaml.safe_dump(SETS, sort_keys=False))
        quoted = {"says": "Of {{ cuts_demonstrations }} all.", "figure": ["space-1.svg"]}
        quoted["opening"] = {"fit-1.svg": "A fit."}
        Path("stages/tasks/recorded.yaml").write_text(yaml.safe_dump({"moves": quoted}))
        Path("stages/tasks/claims").mkdir()
        for name, claims in {
            "moves": [CLAIM | {"simulated": LIKE}, CLAIM | {"statement": "All are", "bound": 4}],
            "arm": [CLAIM | {"statement": "Torques are predicted", "evidence": "nmse"}],
        }.items():
            Path(f"stages/tasks/claims/{name}.yaml").write_text(yaml.safe_dump(claims))
        Path("sets/moves").mkdir(parents=True)
        for number, (duration, rest) in enumerate([(1.0, 0.5), (1.3, 0.7), (0.8, 0.4)], start=1):
            write_reach(Path(f"sets/moves/{number}.mcap"), duration, rest)
        Path("reports/scraping/tables").mkdir(parents=True)
        row = {"by": "published", "statement": LIKE["statement"], "case": "", "verdict": "yes"}
        pd.DataFrame([row]).to_csv("reports/scraping/tables/claims.csv", index=False)
        run_stages(
            root, "moves", "import_task", "segment", "primitives", "feedback", "skill", "check", "report"
        )
        run_stages(root, "arm", "import_task", "motion", "report")
        publish_index()
    return folder


@pytest.fixture
def inside(project, monkeypatch) -> Path:
    monkeypatch.chdir(project)
    monkeypatch.setenv("RECORDED_DATA", "sets")
    return project


def test_the_index_says_what_the_pages_of_the_sets_say(inside):
    page = Path("reports/recorded/index.html").read_text()
    for link in re.findall(r'(?:src|href)="(\.\./tasks/[^"#]*)"', page):
        assert (Path("reports/recorded") / link).exists()
    assert page.index("figures/fit-1.svg") < page.index('id="verdicts"') < page.index("figures/space-1.svg")
    assert "Of 3 all." in page
    assert page.count("Not recorded here.") == 1
    assert Path("data/tasks/arm/motion/absent.txt").exists()
    assert "Not recorded here" in Path("reports/tasks/arm/index.html").read_text()
    assert "Of 1 statements that were also tested in simulation, 1 have the same verdict" in page
    assert words_in_view(page) < 1000


def test_verdicts_are_those_of_the_sets_beside_those_of_simulation(inside):
    table = pd.read_csv("reports/recorded/tables/claims.csv", keep_default_na=False)
    assert table["set"].tolist() == ["Moves of a hand", "Moves of a hand", "arm"]
    assert table["verdict_of_all"].tolist() == ["yes", "no", "not tested"]
    assert table["simulated"].tolist() == ["yes", "", ""]
    own = pd.read_csv("reports/tasks/moves/tables/claims.csv", keep_default_na=False)
    again = claims_table(reload_verdicts("moves", ""))
    pd.testing.assert_frame_equal(again[own.columns], own)
    assert reload_verdicts("moves", "")[0].claim.note == "of all"


def test_make_asks_for_the_stages_of_sets_whose_folder_is_there(inside, monkeypatch):
    shutil.copy(ROOT / CLONE / "dvc.yaml", CLONE)
    of_arm = [f"stages/tasks/dvc.yaml:{stage}@arm" for stage in ("import_motion", "motion")]
    asked = targets("public.yaml")
    assert asked[0] == "stages/tasks/dvc.yaml:import_movement@moves"
    assert asked[asked.index(of_arm[0]) :] == targets("own.yaml", "arm")
    assert targets("own.yaml", "arm")[:2] == of_arm
    monkeypatch.setenv("RECORDED_DATA", "elsewhere")
    with pytest.raises(InputError, match=r"^elsewhere: holds no public set"):
        targets("public.yaml")
