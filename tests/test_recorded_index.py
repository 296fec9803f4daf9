"""Public sets: one that is here, one that is not, and the page over both; the commands that make them."""

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import pytest
import yaml
from committed import ROOT, merged, run_stages
from test_own_demonstrations import QUICK, REACH, write_reach

from dissertation.evidence.claims import QUOTED, claims_table
from dissertation.recorded import recorded_index, set_page
from dissertation.recorded import sets_project as project_of_sets
from dissertation.recorded.people import PEOPLE
from dissertation.recorded.recorded_index import publish_index, reload_verdicts
from structlearn.core.errors import InputError
from structlearn.reporting.document import words_in_view
from structlearn.tasks.project import ENTRIES

LIKE = {"testbed": "scraping", "evidence": "cuts_found", "page": "index"}
CLAIM = {"statement": "Nearly all are cut", "source": "aim", "by": "ours", "evidence": "cuts_demonstrations"}
CLAIM |= {"test": "at least", "bound": 2, "format": ".0f", "note": "of {{ 3 if cuts is defined else 'all' }}"}
SETS = {
    "movement": {"moves": REACH | {"source": "$DATA/moves", "title": "Moves of a hand"}},
    "motion": {"arm": {"source": "$DATA/arm", "urdf": "$DATA/arm.urdf"}},
    "touch": {},
    "obstacles": {},
}


@pytest.fixture(scope="module")
def project(tmp_path_factory) -> Iterator[Path]:
    """All stages of both sets have run, of which one is not here."""
    clone = tmp_path_factory.mktemp("public")
    folder = clone / "data/recorded"
    with pytest.MonkeyPatch.context() as patch:
        folder.mkdir(parents=True)
        patch.chdir(folder)
        patch.setenv("RECORDED_DATA", "sets")
        own = SETS | {"movement": {"moves": merged({"fit": QUICK["fit"]}, SETS["movement"]["moves"])}}
        ENTRIES.write_text(yaml.safe_dump(own, sort_keys=False))
        quoted = {"says": "Of {{ cuts_demonstrations }} all.", "figure": ["space-1.svg"]}
        quoted["opening"] = {"fit-1.svg": "A fit."}
        (clone / "recorded.yaml").write_text(yaml.safe_dump({"moves": quoted}))
        (clone / "claims").mkdir()
        for name, claims in {
            "moves": [CLAIM | {"simulated": LIKE}, CLAIM | {"statement": "All are", "bound": 4}],
            "arm": [CLAIM | {"statement": "Torques are predicted", "evidence": "nmse"}],
        }.items():
            (clone / f"claims/{name}.yaml").write_text(yaml.safe_dump(claims))
        (clone / "claims/published.yaml").write_text("{}")
        patch.setattr(recorded_index, "HERE", clone)
        patch.setattr(recorded_index, "QUOTED", clone / "recorded.yaml")
        patch.setattr(set_page, "CLAIMS", clone / "claims")
        Path("sets/moves").mkdir(parents=True)
        for number, (duration, rest) in enumerate([(1.0, 0.5), (1.3, 0.7), (0.8, 0.4)], start=1):
            write_reach(Path(f"sets/moves/{number}.mcap"), duration, rest)
        (clone / "reports/scraping/tables").mkdir(parents=True)
        row = {"statement": "Cuts are found", "evidence": LIKE["evidence"], "case": "", "verdict": "yes"}
        pd.DataFrame([row]).to_csv(clone / "reports/scraping/tables/claims.csv", index=False)
        learning = ("segment", "primitives", "feedback", "skill", "check")
        page = ROOT / "stages/recorded/report.py"
        run_stages("moves", "import_task", *learning, page)
        run_stages("arm", "import_task", "learn", page)
        shutil.copy(ROOT / QUOTED / "people.csv", PEOPLE)
        publish_index()
        yield folder


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
    assert 'id="table-people"' in page
    quoted = ROOT / QUOTED / "people.csv"
    assert Path("reports/recorded/tables/people.csv").read_bytes() == quoted.read_bytes()
    assert words_in_view(page) < 1000


def test_verdicts_are_those_of_the_sets_beside_those_of_simulation(inside):
    table = pd.read_csv("reports/recorded/tables/claims.csv", keep_default_na=False)
    assert table["set"].tolist() == ["Moves of a hand", "Moves of a hand", "arm"]
    assert table["verdict_of_all"].tolist() == ["yes", "no", "not tested"]
    assert table["simulated"].tolist() == ["yes", "", ""]
    texts = dict.fromkeys(("number", "bound"), str)
    own = pd.read_csv("reports/tasks/moves/tables/claims.csv", keep_default_na=False, dtype=texts)
    again = claims_table(reload_verdicts("moves", ""))
    pd.testing.assert_frame_equal(again[own.columns], own)
    assert reload_verdicts("moves", "")[0].claim.note == "of all"


def test_the_project_is_written_where_there_is_a_public_set(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RECORDED_DATA", "elsewhere")
    with pytest.raises(InputError, match=r"^elsewhere: holds no public set"):
        project_of_sets.main()
    assert not Path("data").exists()
    Path("elsewhere/slide").mkdir(parents=True)
    project_of_sets.main()
    made = {path.name for path in Path("data/recorded").iterdir()}
    assert made >= {".dvc", "dvc.yaml", "structlearn.yaml", ".structlearn.yaml"}
