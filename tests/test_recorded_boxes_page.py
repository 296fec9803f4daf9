"""The page and the recording of reaches past boxes, from tables that are made up."""

from functools import lru_cache
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from committed import committed
from reporting_verdicts import AnyFigure, verdicts
from viewer_files import colour_of, contents, note

from structlearn.avoidance.scene_folds import MODELS, WAYS
from structlearn.avoidance.scene_models import SCENE, TEXT
from structlearn.avoidance.scene_people import ScenePeopleParameters
from structlearn.core.metrics import wilson_interval
from structlearn.reporting.document import render
from structlearn.tasks.public.page import parts
from structlearn.tasks.public.page.assembly import recorded_report
from structlearn.tasks.public.page.parts.boxes_part import (
    KEY,
    PART,
    BoxesFound,
    boxes_evidence,
    boxes_metrics,
)
from structlearn.tasks.public.page.recorded_results import RecordedResults
from structlearn.tasks.public.public_names import BOX_WAYS
from structlearn.tasks.public.views.boxes_recording import write_box_reaches

PEOPLE, REACHES = 12, 20
PARAMETERS = {KEY: committed(ScenePeopleParameters, KEY)}


@lru_cache
def made_up(good=True):
    """Reaches in which every claim holds, or none does.

    Person 1 touches a box once and takes another gap: if nobody did, how people differ would be unknown.
    """
    touching = dict.fromkeys(WAYS, 10) | {"none": 11, "human_inspired": 11}
    if good:
        touching |= {TEXT: 0, "text_ensemble": 8, SCENE: 0, "planned": 0}
    else:
        touching |= {TEXT: 12, "text_ensemble": 5, SCENE: 9}
    path = dict.fromkeys(WAYS, 40.0) | {SCENE: 15.0 if good else 45.0}
    left = dict.fromkeys(WAYS, 3.0) | ({} if good else {TEXT: 500.0, SCENE: 90.0})
    rows = [
        {
            "way": way,
            "reach": f"p{person}_{number}",
            "person": f"p{person}",
            "fold": person % 4,
            "blocked": number < 12,
            "hit": number < touching[way] - (person % 3 == 0 and touching[way] > 1) + (person == 1),
            "hit_wall": False,
            "clearance_mm": 30.0,
            "left_mm": left[way],
            "path_mm": path[way] + 0.1 * person * (way == SCENE),
            "same_gaps": (good and (person, number) != (1, 0)) or way != SCENE or number > 5,
        }
        for way, person, number in product(WAYS, range(PEOPLE), range(REACHES))
    ]
    errors = [(way, axis, 4.0, 8.0, fold) for way in MODELS for axis in "xyz" for fold in range(4)]
    time = np.linspace(0.0, 1.5, 20)
    paths = [
        pd.DataFrame({"reach": reach, "way": way, "time_s": time, "x_m": 0.1, "y_m": time / 3, "z_m": 0.8})
        for reach in ("p0_1", "p1_1", "p2_1")
        for way in ("recorded", *WAYS)
    ]
    shapes = [
        (reach, box, 0.2 * box, -0.05, 0.79, 0.1, 0.05, 0.12)
        for reach in ("p0_1", "p1_1", "p2_1")
        for box in (True, True, False)
    ]
    extent = ["x_m", "y_m", "z_m", "width_m", "depth_m", "height_m"]
    return BoxesFound(
        {
            "reaches": pd.DataFrame(rows),
            "errors": pd.DataFrame(errors, columns=["way", "axis", "squared", "variance", "fold"]),
            "people": pd.DataFrame(
                [("p0", "p1", "p0_1", 28.0, True)],
                columns=["first", "second", "reach", "path_mm", "same_gaps"],
            ),
            "left_out": pd.DataFrame({"trial": ["p0_9"], "person": ["p0"], "reason": ["takes 5.0 s"]}),
            "paths": pd.concat(paths, ignore_index=True),
            "shapes": pd.DataFrame(shapes, columns=["reach", "box", *extent]),
        }
    )


def results(found):
    """As the pages take them."""
    return RecordedResults(
        {f"boxes_{name}": its for name, its in found.tables.items()}, parameters=PARAMETERS
    )


def page(found):
    return render(recorded_report(results(found), Path("no such folder")).pages["boxes"], AnyFigure())


def test_where_no_reach_touches_a_box_people_are_few():
    """Of 12 people none touches: up to 22 % of others may, however many reaches there were."""
    clean = made_up()["reaches"].assign(hit=False)
    found = boxes_evidence(BoxesFound(made_up().tables | {"reaches": clean}))
    assert found["hits"].high == pytest.approx(1 - 0.05 ** (1 / PEOPLE))
    words = verdicts(parts.__name__, found, "boxes_claims.yaml")
    rates = {"text_hits", "hits", "hits_blocked", "text_hits_fewer", "text_hits_fewer_than_rai"}
    assert {words[name] for name in (*rates, "features_alone")} == {"undecided"}


def test_metrics_pool_reaches_and_cluster_people():
    values = boxes_metrics(made_up())
    assert values["boxes_hits"] == 1 / 240
    assert values["boxes_hits_high"] == wilson_interval(1, 240)[1]  # wider than by people's rates
    hits = made_up().of("none").groupby("person")["hit"].mean()
    assert values["boxes_hits_none"] == pytest.approx(hits.mean())
    assert values["boxes_hits_none_low"] < hits.mean() < values["boxes_hits_none_high"]
    assert values["boxes_goal_max_mm"] == 3.0
    assert values["boxes_path_mm"] == pytest.approx(15.0 + 0.1 * np.arange(PEOPLE).mean())
    assert values["boxes_nmse_x"] == 0.5
    asked = {"boxes_hits_blocked", "boxes_same_gap", "boxes_hits_text_features", "boxes_hits_planned"}
    assert asked <= set(values)


def test_one_person_alone_in_scenes_of_their_own_without_a_blocked_reach():
    tables = dict(made_up().tables)
    reaches = tables["reaches"].query("person == 'p1' and not blocked")
    tables |= {name: tables[name][:0] for name in ("people", "left_out", "paths", "shapes")}
    found = BoxesFound(tables | {"reaches": reaches})
    asked = results(found)
    text, drawn = page(found), PART.pictures(asked)
    assert set(drawn) == {"boxes_rates"}
    assert "unknown % of them take the same gaps" in text
    judged = {one.claim.evidence: one.verdict for one in recorded_report(asked).pages["boxes"].judged}
    assert judged["hits_blocked"] == "not tested"
    assert judged["path"] == "undecided"  # one person has no interval
    assert {"boxes_people_apart_mm", "boxes_hits_blocked"}.isdisjoint(recorded_report(asked).metrics)


def test_the_recording_shows_every_scene_and_way(tmp_path):
    path = tmp_path / "boxes.rrd"
    write_box_reaches(path, made_up().tables)
    rows, entities, _ = contents(path)
    name = BOX_WAYS["scene"].name.replace(" ", "\\ ")
    assert colour_of(path, f"/p0_1/{name}/path", "LineStrips3D") == BOX_WAYS["scene"].colour
    for reach in ("p0_1", "p1_1", "p2_1"):
        assert {f"/{reach}/boxes", f"/{reach}/walls", f"/{reach}/person/hand"} <= entities
    assert rows["/p0_1/person/hand"] == 20
    assert "recorded" in note(path)
