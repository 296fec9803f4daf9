"""Crash points of everything that is published; `make kills` tries them with other losses."""

import pytest
from faults.crashes import WORKS, outcomes

from structlearn.ground import publication
from structlearn.policy_search import checkpoint


@pytest.mark.parametrize("name", WORKS)
def test_a_crash_at_any_step_heals(tmp_path, name):
    found = dict(outcomes(WORKS[name], tmp_path / "root", seed=0))
    assert len(found) > 6
    assert {step: fault for step, fault in found.items() if fault} == {}


def test_what_is_not_brought_to_the_disk_is_missed(tmp_path, monkeypatch):
    monkeypatch.setattr(publication, "_to_disk", lambda *arguments, **options: None)
    found = dict(outcomes(WORKS["a file over another"], tmp_path / "root", seed=0))
    assert "note.txt is neither as before nor as after" in found.values()


def test_what_is_deleted_step_by_step_is_found_out(tmp_path, monkeypatch):
    monkeypatch.setattr(checkpoint, "discard", publication.shutil.rmtree)
    ends = WORKS["a refinement that ends"]
    work = type(ends)(ends.before, lambda root: publication.shutil.rmtree(root / "unfinished"), ends.whole)
    assert (
        "unfinished is neither as before nor as after"
        in dict(outcomes(work, tmp_path / "root", seed=0)).values()
    )
