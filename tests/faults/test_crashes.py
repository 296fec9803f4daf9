"""Crash points of everything that is published; `make kills` tries them with other losses."""

import os

import pytest
from faults.crashes import WORKS, outcomes

from structlearn.core import publication


@pytest.fixture(autouse=True)
def without_waiting_for_the_disk(monkeypatch):
    """What was brought there is known by the calls."""
    monkeypatch.setattr(os, "fsync", lambda file: None)


@pytest.mark.parametrize("name", WORKS)
def test_a_crash_at_any_step_heals(tmp_path, name):
    found = dict(outcomes(WORKS[name], tmp_path / "root", seed=0))
    assert len(found) > 6
    assert {step: fault for step, fault in found.items() if fault} == {}


def test_what_is_not_brought_to_the_disk_is_missed(tmp_path, monkeypatch):
    monkeypatch.setattr(publication, "_to_disk", lambda *arguments, **options: None)
    work = WORKS["a file over another"]
    found = {fault for seed in range(2) for _, fault in outcomes(work, tmp_path / "root", seed)}
    assert "note.txt is neither as before nor as after" in found
