"""Verdicts of two runs: other digits are no other verdict, undecided is none either."""

import shutil
import subprocess
from dataclasses import replace

import pandas as pd
import pytest

from dissertation.evidence.claims import claims_table, judge, read_claims
from dissertation.evidence.committed import main
from dissertation.evidence.verdicts import (
    DIGITS,
    FLIPPED,
    MARGIN,
    QUOTED,
    SAME,
    changes,
    compared,
)
from structlearn.reporting.evidence import Evidence

COLUMNS = ["statement", "case", "here", "verdict"]
HERE = pd.DataFrame(
    [("a", "", "1.0", "yes"), ("b", "", "2.0", "yes"), ("c", "x", "3", "no"), ("c", "y", "4", "yes")],
    columns=COLUMNS,
)


@pytest.mark.parametrize(
    ("row", "outcome"),
    [
        (("b", "", "2.0", "yes"), SAME),
        (("b", "", "2.1", "yes"), DIGITS),
        (("b", "", "2.1", "undecided"), MARGIN),
        (("b", "", "2.0", "undecided"), MARGIN),  # at the bound: the printed digits do not tell
        (("b", "", "2.0", "no"), FLIPPED),
        (("b", "", "2.1", "no"), FLIPPED),
        (("b", "", "2.1", "not tested"), FLIPPED),
        (("another", "", "2.0", "yes"), FLIPPED),
    ],
)
def test_only_another_verdict_counts_as_one(row, outcome):
    there = HERE.copy()
    there.loc[1] = row
    table = compared({"toy": HERE}, {"toy": there}).set_index("statement")
    assert table.loc["b", "outcome"] == outcome
    assert set(table.drop(index=["b", "another"], errors="ignore")["outcome"]) == {SAME}


def test_rows_quoted_from_a_study_are_not_counted_as_run(tmp_path):
    (tmp_path / "claims.yaml").write_text(
        "- {statement: ran, source: IV, evidence: ran, test: above}\n"
        "- {statement: read, source: IV, evidence: read, test: above}\n"
    )
    above = Evidence(1.0, 0.5, 1.5, 5)
    read = replace(above, study="toy/people")
    found = {"ran": above, "read": {"a": read, "b": read}}
    claims = read_claims(tmp_path / "claims.yaml")
    table = claims_table(judge(claims, found, {}))
    assert table["study"].tolist() == ["", "toy/people", "toy/people"]
    outcomes = compared({"toy": table}, {"toy": table}).set_index(["statement", "case"])["outcome"]
    assert outcomes.to_dict() == {("ran", ""): SAME, ("read", "A"): QUOTED, ("read", "B"): QUOTED}
    other = table.assign(verdict="undecided")  # whatever the reason: a changed word is shown
    assert set(compared({"toy": table}, {"toy": other})["outcome"]) == {MARGIN}


def test_rows_are_held_against_their_likes_and_changed_words_are_named_one_by_one():
    """Cases of one statement are kept apart; the same words may stand for two sets, or for two origins."""
    there = HERE.assign(verdict=["yes", "undecided", "yes", "yes"], here=["1.1", "2.1", "3.1", "4"])
    assert changes(compared({"toy": HERE}, {"toy": there[:3]})) == [
        "toy: b: yes -> undecided (2.0 -> 2.1)",
        "toy: c: x: no -> yes (3 -> 3.1)",
        "toy: c: y: yes -> no such row (4 -> no such row)",
    ]
    twice = pd.concat([HERE.assign(set="a", by="published"), HERE.assign(set="b", by="published")])
    twice = pd.concat([twice, HERE.assign(set="b", by="ours", verdict="no")])
    table = compared({"toy": twice}, {"toy": twice})
    assert len(table) == len(twice)
    assert set(table["outcome"]) == {SAME}


LOCK = """stages:
  toy_view:
    outs:
    - path: reports/rerun/toy
      hash: md5
      md5: aa
  toy_report:
    outs:
    - path: reports/toy/tables
      md5: bb
"""


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project of one stage, committed, in the working directory."""
    monkeypatch.chdir(tmp_path)
    tables = tmp_path / "reports/toy/tables"
    tables.mkdir(parents=True)
    HERE.to_csv(tables / "claims.csv", index=False)
    (tmp_path / "dvc.yaml").write_text("stages: {toy: {outs: [{reports/toy/tables: {cache: false}}]}}")
    (tmp_path / "dvc.lock").write_text(LOCK)
    (tmp_path / "README.md").write_text("")
    git = ["git", "-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false"]
    for words in (["init", "--quiet"], ["add", "."], ["commit", "--quiet", "--message", "tables"]):
        subprocess.run([*git, *words], check=True)
    return tmp_path


def printed(capsys) -> list[str]:
    main()
    return capsys.readouterr().out.splitlines()


def test_what_the_pipeline_made_is_as_committed_or_named(project, capsys):
    """A verdict that changed and a row that is gone are printed; other digits count as a row that differs."""
    file = project / "reports/toy/tables/claims.csv"
    assert printed(capsys) == ["as committed: 4 of 4 rows, 3 of 3 files"]
    (project / "src.py").write_text("x = 1")  # written by no stage
    HERE.assign(here=["1.1", "2.0", "3", "4"]).to_csv(file, index=False)
    assert printed(capsys) == [
        "no verdict changed",
        "differs from the last commit: reports/toy/tables/claims.csv",
        "as committed: 3 of 4 rows, 2 of 3 files",
    ]
    HERE.assign(verdict=["undecided", "yes", "no", "yes"])[:3].to_csv(file, index=False)
    (file.parent / "more.csv").write_text("a new table")
    assert printed(capsys) == [
        "toy: a: yes -> undecided (1.0 -> 1.0)",
        "toy: c: y: yes -> no such row (4 -> no such row)",
        "differs from the last commit: reports/toy/tables/claims.csv",
        "differs from the last commit: reports/toy/tables/more.csv",
        "as committed: 2 of 4 rows, 2 of 4 files",
    ]


def test_only_recordings_may_differ_in_the_lock(project, capsys):
    lock = project / "dvc.lock"
    lock.write_text(LOCK.replace("md5: aa", "md5: a1"))
    assert printed(capsys) == ["as committed: 4 of 4 rows, 3 of 3 files"]
    lock.write_text(LOCK.replace("md5: bb", "md5: b1"))
    assert printed(capsys)[-2:] == [
        "differs from the last commit: dvc.lock",
        "as committed: 4 of 4 rows, 2 of 3 files",
    ]


def test_without_a_commit_there_is_nothing_to_compare_with(project):
    shutil.rmtree(project / ".git")
    with pytest.raises(SystemExit, match=r"nothing to compare with: .*not a git repository"):
        main()
