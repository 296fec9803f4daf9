"""What is held out trains nothing: models are the same to the bit, whatever the data held out say.

Every stage and every function that fits something has a case here, or says why it holds nothing out. A case
runs what its stage calls on small data three times: as they are, with what is held out changed, and with
something changed that is learned from. The models may not change but for the last. Of a cross-validation they
are those of one fold.

Places are what folds and distances on a skin are made of, so of touches the readings are changed.
"""

import ast
import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import FunctionType, MethodType
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sklearn.linear_model
import test_movement_phase_corrections
import test_simulation_board_refinement
import test_task_motion
import test_tasks_obstacles
import test_torque_parts
import test_touch_skin
import test_touch_transfer
import torch
from board_rollouts import small_board
from committed import ROOT, SETS, TASK_FILE, committed, committed_entry, read_yaml
from conftest import two_move_demonstration
from feedback_toy import toy_dataset
from reporting_scraping import PARAMETERS as CUTTING
from rigid_body_robots import arm, motion_with_friction, sine_motion
from tactile_toy import toy_dataset as toy_touches
from tactile_toy import toy_geodesics
from test_obstacles_models import PARAMETERS as AVOIDANCE
from test_obstacles_models import SCENARIOS
from test_obstacles_models import toy_dataset as toy_reaches
from test_tasks_obstacles import phase_dependent
from threadpoolctl import threadpool_limits

import structlearn
from dissertation.dynamics.protocol.trainings import (
    DynamicsTrainingParameters,
    EpochLimits,
    train_all,
    trainings,
)
from dissertation.obstacles.protocol import avoidance_fits, avoidance_scores
from dissertation.obstacles.world.reaching_person import AvoiderParameters
from dissertation.obstacles.world.scenarios import SceneParameters, scenarios
from dissertation.recorded.coupling import learning as coupling_representations
from dissertation.recorded.parts import learning as torque_parts
from dissertation.recorded.transfer import learning as touch_transfer
from dissertation.scraping.files import read_datasets
from dissertation.scraping.protocol import feedback_models
from dissertation.scraping.protocol.board_refinement import refine_on_board
from dissertation.scraping.protocol.feedback_models import (
    LEVEL,
    POINTWISE,
    UNROLLED,
    FinalModelParameters,
    compare_representations,
    train_models,
)
from structlearn.avoidance import scene_models
from structlearn.avoidance.avoidance_dataset import AvoidanceDataParameters
from structlearn.avoidance.network_training import held_out_rows
from structlearn.core.artefacts import write_table
from structlearn.core.parallel import BACKEND
from structlearn.feedback.corrected_paths import SAMPLES, corrected_paths, split_demonstrations
from structlearn.feedback.coupling_dataset import (
    CouplingDataset,
    concatenated,
    leave_one_out,
    to_table,
    without_generalization,
)
from structlearn.feedback.trainers import TrainingParameters
from structlearn.networks.torch_settings import one_thread
from structlearn.primitives import fitting
from structlearn.primitives.fitting import FitParameters, cross_validation
from structlearn.primitives.position import fit_position
from structlearn.primitives.trajectory import differentiated
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.joint_log import DriveLog
from structlearn.readers.touch_log import TouchLog
from structlearn.rigid_body.dynamics_training import LearningParameters
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.payload import PayloadLearningParameters, learn_payload
from structlearn.segmentation.segments import cut
from structlearn.tactile import latent_comparison
from structlearn.tactile.latent_parameters import LatentParameters
from structlearn.tactile.pressed_skin import PressedSkin, held_out
from structlearn.tactile.touch_dataset import TRAIN
from structlearn.tasks.motion import learning as motion_learning
from structlearn.tasks.motion.learning import choose_networks, learn_motion
from structlearn.tasks.motion.parameters import LEARNED, NetworkChoiceParameters
from structlearn.tasks.movement import feedback_learning
from structlearn.tasks.movement.movement_learning import segmented
from structlearn.tasks.movement.parameters import TaskFeedbackParameters
from structlearn.tasks.movement.phase_corrections import _split, learn_corrections, runs_with_coupling
from structlearn.tasks.obstacles.learning import learn_past_obstacles
from structlearn.tasks.project import STAGES
from structlearn.tasks.touch import learning as touch_learning
from structlearn.tasks.touch import skin_force, skin_readings, skin_within_runs, surface_traces
from structlearn.tasks.touch.skin_touches import learn_skin
from structlearn.tasks.touch.surface_traces import deviations_from_expected

HOLDS_NOTHING_OUT = {
    "simulates": "engines studies/cell scraping/record_nominal scraping/record_corrections "
    "obstacles/demonstrate dynamics/record_motion dynamics/track servoing/record_touch servoing/servo",
    "reads recordings": "tasks/import_task scraping/import_nominal "
    "scraping/import_corrections dynamics/import_logs servoing/import_touch",
    "cuts demonstrations": "tasks/segment scraping/segment scraping/sweep",
    "puts into one file what was learned": "tasks/skill scraping/write_skill",
    "executes or unrolls": "tasks/check scraping/evaluate_feedback scraping/evaluate_refinement "
    "obstacles/evaluate",
    "states results": "dynamics/results scraping/results obstacles/results servoing/results",
    "traces of all runs that it is given; the further ones go to other files": "scraping/expected_traces",
    "makes samples, each of one demonstration": "scraping/coupling_dataset servoing/touch_dataset",
    "searches by trial, on rollouts of its own": "scraping/compare_search",
    "distances between all places that were touched, those of the test among them": "servoing/geodesics",
    "describes how people differ, predicts nothing": "recorded/people",
}
"""Why stages have no case."""

FITS_ALL = {
    "takes out of trials what their layouts explain": "people._spread",
    "call those that have a case": "transfer.compare_sets motion.learn touch.learn obstacles.learn "
    "parts.learn avoidance_fits._errors fitting.learn_sequence "
    "autoencoded.train pca.train pca.train_on_codes",
    "what is compared with itself": "movement_learning.reproduction movement_learning.turn_errors "
    "drives_and_load.payload_check differing_motion.differing_errors finger_statistics.pca_dimensions "
    "trainings._once_through training_choice.try_trainings",
    "traces of all runs that are given": "feedback_learning.learn_feedback movement_learning.learn_traces",
    "searches by rollouts": "sample_efficiency._advance",
    "call the training of `train_latent` for another skin": "servo_trials.learn_other_skin",
    "learn from runs that are given, and are judged by executions": "imitation_data.recorded_person "
    "imitation_data.bench_of policies.train protocol.trained protocol.trained_feedback reaches.demonstrated "
    "reaching_protocol.trained_reaches",
}
"""Why functions that fit have no case."""

LEARNERS = (
    r"_?(fit|partial_fit|learn|train)(_\w+)?|\w*[Ll]earner|\w+_trainer|lstsq|unconstrained_minimiser|svd|PCA"
    r"|polynomial|\w+_process|own_units|levenberg_marquardt"
)
SEPARATES = r"held_out|left_out|leave_one_out|TRAIN|[Ff]olds?|judged"
"""Names of what fits, and names in modules of methods that hold something out."""

DRAWS = r"stages|page|recordings|world|simulation|reporting|viewer|\w+_(section|view|figures)"
"""Packages and modules that fit nothing, or show or simulate it."""

SHOWS = ("report", "view", "loop", "make_example")
"""Stages that show what others wrote."""


@dataclass(frozen=True)
class Case:
    """One fit three times: of the data, with held-out samples changed, and with training samples changed."""

    learn: Callable[[Any], Any]
    data: Any
    held_out: Any
    trained_on: Any


CASES: list[tuple[str, Callable[..., Case]]] = []
"""Stage, and what makes its case from pytest's `monkeypatch` and a folder."""


FITS: dict[str, str] = {}
"""Functions that fit something, by the case that compares what they learn."""


def of_stage(*stages: str, fits: str = "") -> Callable[[Callable[..., Case]], Callable[..., Case]]:
    """Register a case of stages, and the functions (`module.name`) whose fits it compares."""

    def registered(make: Callable[..., Case]) -> Callable[..., Case]:
        CASES.extend((stage, make) for stage in stages)
        FITS.update(dict.fromkeys(fits.split(), make.__name__))
        return make

    return registered


def once(learn: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """The same function, which learns once from the same data: for cases that share them."""
    known: dict[int, tuple[Any, Any]] = {}

    def learned(data):
        if id(data) not in known:
            known[id(data)] = data, learn(data)
        return known[id(data)][1]

    return learned


def each(
    monkeypatch: pytest.MonkeyPatch, module: Any, name: str, run: Callable[[Any], object]
) -> Callable[[Any], list]:
    """From data to what every call of a module's function returned while `run` ran on them, once."""
    real, found = getattr(module, name), []

    def remembered(*arguments, **others):
        found.append(real(*arguments, **others))
        return found[-1]

    def learn(data):
        found.clear()
        run(data)
        return list(found)

    monkeypatch.setattr(module, name, remembered)
    return once(learn)


def wobbling(values: np.ndarray, rows: Any = slice(None), share: float = 0.2) -> np.ndarray:
    """Values (T, ...), of which some rows swing by a share of what they are."""
    found = np.array(values)
    wave = 1.0 + share * np.sin(np.linspace(0.1, 7.0, len(found)))
    found[rows] = (found.T * wave).T[rows].astype(found.dtype)
    return found


def with_wobbling(samples: Any, rows: Any, *names: str) -> Any:
    """A dataclass of arrays, of which some columns wobble in some rows."""
    return replace(samples, **{name: wobbling(getattr(samples, name), rows) for name in names})


def swapped(items: list, place: int, one: Any) -> list:
    return [*items[:place], one, *items[place + 1 :]]


SOURCES = Path(structlearn.__file__).parents[1]


# --- primitives --------------------------------------------------------------------------------------------

FIT = committed(FitParameters, "fit_primitives", kernel_count=8)
LEFT_OUT, ANOTHER = 1, 2
"""Place of what is left out, and of what is learned from."""


def moved(demonstrations: list[Demonstration], place: int) -> list[Demonstration]:
    one = demonstrations[place]
    return swapped(demonstrations, place, replace(one, position=wobbling(one.position)))


def demonstrations(stretches=(1.0, 1.2, 0.85)) -> list[Demonstration]:
    return [two_move_demonstration(f"{place}", one) for place, one in enumerate(stretches)]


def without_fold(monkeypatch, run: Callable[[Any], object], count: int, size: int) -> Callable[[Any], list]:
    """From data to the primitives without a fold of so many demonstrations, the one with `LEFT_OUT`."""
    real, found = fitting.learn_subsets, []

    def remembered(*arguments):
        fit = real(*arguments)

        def of_some(used, method):
            found.append((used, fit(used, method)))
            return found[-1][1]

        return of_some

    @once
    def learn(data):
        found.clear()
        run(data)
        assert all((~used).sum() <= size < count for used, _ in found)
        return [one for used, one in found if not used[size * LEFT_OUT]]

    monkeypatch.setattr(fitting, "learn_subsets", remembered)
    return learn


@of_stage(
    "scraping/fit_primitives",
    "tasks/primitives",
    fits="fitting.primitive_errors fitting.learn_primitive fitting.learn_subsets",
)
def primitives(monkeypatch, tmp_path):
    """Of every primitive and regression, the primitive learned from all demonstrations but one."""
    data = demonstrations()
    cuts = cut(data, CUTTING).results
    learn = without_fold(monkeypatch, lambda its: cross_validation(its, cuts, FIT), len(data), 1)
    return Case(learn, data, moved(data, LEFT_OUT), moved(data, ANOTHER))


def higher(place: int | None = None) -> list[Demonstration]:
    arcs = test_movement_phase_corrections
    heights = [height + 0.05 * (number == place) for number, height in enumerate(arcs.HEIGHTS_M)]
    return [
        arcs.arc(str(number), height, 0.6 + 0.05 * number, dt=0.004, shift=0.01 * number)
        for number, height in enumerate(heights)
    ]


@of_stage("tasks/primitives")
def two_at_a_time(monkeypatch, tmp_path):
    cuts = segmented(higher(), "reach", None).results
    run = lambda its: cross_validation(its, cuts, FIT, fold=2)  # noqa: E731
    learn = without_fold(monkeypatch, run, len(higher()), 2)
    return Case(learn, higher(), higher(2 * LEFT_OUT), higher(2 * ANOTHER))


@of_stage("tasks/feedback")
def corrections(monkeypatch, tmp_path):
    arcs = test_movement_phase_corrections
    nominal = fit_position([differentiated(higher()[0].position, 0.004, 20.0)])
    learned, left_out = _split(len(higher()), 0)

    def learn(demonstrations):
        found = runs_with_coupling(demonstrations, nominal, 20.0)
        return learn_corrections(found, nominal.local, arcs.PARAMETERS)[0]

    return Case(learn, higher(), higher(left_out[0]), higher(learned[0]))


SLIDES = committed_entry("slides", surfaces={"material": "mat", "left_out": ("mat_3",)}).surfaces


def slid(changed: str = "") -> list[Demonstration]:
    time, found = np.arange(120) / 100.0, []
    for number, name in enumerate(("mat_1", "mat_2", "mat_3", "cork_1", "cork_2")):
        counts = np.sin(time[:, None] * (1.0 + np.arange(19)) + 0.1 * number) * 30.0
        counts = wobbling(counts) if name == changed else counts
        found.append(Demonstration(name, time, np.zeros((120, 3)), tactile=counts))
    return found


@of_stage("tasks/touch", fits="surface_traces.deviations_from_expected")
def expected_of_slides(monkeypatch, tmp_path):
    learn = once(lambda its: deviations_from_expected(its, SLIDES)[0])
    data, trained_on = slid(), slid("mat_2")
    return [Case(learn, data, slid(held_out), trained_on) for held_out in ("mat_3", "cork_1")]


@of_stage("tasks/touch", fits="surface_traces._held_out")
def slides_left_out(monkeypatch, tmp_path):
    learn = each(
        monkeypatch,
        surface_traces,
        "fit_expected_traces",
        lambda its: surface_traces.left_out_deviations(its, SLIDES),
    )
    return Case(lambda its: learn(its)[1], slid(), slid("mat_2"), slid("mat_1"))


@of_stage("tasks/touch", fits="surface_traces.across_materials")
def other_materials(monkeypatch, tmp_path):
    learn = each(
        monkeypatch,
        surface_traces,
        "fit_expected_traces",
        lambda its: surface_traces.across_materials(its, SLIDES),
    )
    return Case(lambda its: learn(its)[4], slid(), slid("cork_1"), slid("mat_2"))


# --- feedback ----------------------------------------------------------------------------------------------

FEEDBACK = committed(
    FinalModelParameters,
    "train_feedback",
    hidden=(4,),
    pointwise={"steps": 20, "evaluate_every": 10},
    unrolled={"steps": 1},
)
TRAINING = committed(TrainingParameters, "compare_models", steps=20, evaluate_every=10, batch_size=16)
KNOWN, NEW = (0.0, 5.0), 10.0
"""Settings learned from, and one that is not."""


def corrected(dataset: CouplingDataset, rows: np.ndarray) -> CouplingDataset:
    return with_wobbling(dataset, rows, "deviation", "target")


@of_stage(
    "scraping/train_feedback",
    fits="trainers.train_final supervised_training.train_stack feedback_models._trained",
)
def final_feedback(monkeypatch, tmp_path):
    """By the model's own split: samples that test, and settings that nobody learns from."""
    whole, level = toy_dataset(seed=0), toy_dataset(settings=(0.0,), seed=1)
    kept = np.isin(whole.setting, KNOWN)

    def learn(dataset, model):
        write_table(to_table(dataset), tmp_path / "turn.parquet")
        return train_models(read_datasets(tmp_path, KNOWN), {"turn": level}, FEEDBACK, (model,))

    for model in (POINTWISE, LEVEL):
        seen = whole.where(kept) if model == POINTWISE else concatenated([whole.where(kept), level])
        fold = without_generalization(seen, FEEDBACK.pointwise.chunk_samples, FEEDBACK.pointwise.seed)
        own = np.flatnonzero(kept)
        tested, trained_on = (own[part[part < len(own)]] for part in (fold.test, fold.train[:1]))
        learned, changed = once(partial(learn, model=model)), corrected(whole, trained_on)
        for rows in (tested, whole.setting == NEW):
            yield Case(learned, whole, corrected(whole, rows), changed)


@of_stage("scraping/train_feedback")
def start_of_unrolled_feedback(monkeypatch, tmp_path):
    """What training inside the unroll starts from has not seen the demonstrations that choose its step."""
    data = toy_dataset()
    paths = corrected_paths(data, SAMPLES)
    trained_on, chooses = (
        np.isin(data.demonstration, part.demonstration)
        for part in split_demonstrations(paths, FEEDBACK.validation_share, FEEDBACK.unrolled.seed)
    )
    learn = each(
        monkeypatch,
        feedback_models,
        "train_final",
        lambda its: train_models({"turn": its}, {}, FEEDBACK, (UNROLLED,)),
    )
    return Case(learn, data, corrected(data, chooses), corrected(data, trained_on))


@of_stage(
    "scraping/compare_models",
    fits="feedback_models._evaluated autoencoded.autoencoder pca.principal_components",
)
def representations(monkeypatch, tmp_path):
    """Of one fold, errors on what every representation was learned from, at the step validation chose."""
    data = toy_dataset(samples=(30, 35))
    fold = leave_one_out(data, TRAINING.chunk_samples, TRAINING.seed)[LEFT_OUT]

    @once
    def learn(dataset):
        found = compare_representations({"turn": dataset}, TRAINING)["turn"]
        chosen = (found["fold"] == LEFT_OUT) & (found["stopping"] == "validation")
        return found.loc[chosen, ["step", "train", "validation", "dimensions"]]

    trained_on = corrected(data, fold.train[:1])
    for rows in (fold.generalization, fold.test):
        yield Case(learn, data, corrected(data, rows), trained_on)


@of_stage("scraping/compare_models")
def steps_of_representations(monkeypatch, tmp_path):
    """Samples that choose the step train nothing: of a single step there is no choice."""
    once_evaluated = TRAINING.model_copy(update={"evaluate_every": TRAINING.steps})
    data = toy_dataset(samples=(30, 35))
    fold = leave_one_out(data, TRAINING.chunk_samples, TRAINING.seed)[LEFT_OUT]

    def learn(dataset):
        found = compare_representations({"turn": dataset}, once_evaluated)["turn"]
        chosen = (found["fold"] == LEFT_OUT) & (found["stopping"] == "validation")
        return found.loc[chosen, ["step", "train", "dimensions"]]

    return Case(learn, data, corrected(data, fold.validation), corrected(data, fold.train[:1]))


@of_stage("scraping/refine", fits="board_refinement._learned")
def refinement(monkeypatch, tmp_path):
    """Before and after: demonstrations on the board's new tilt are never read."""
    boards = test_simulation_board_refinement
    parameters = boards.PARAMETERS.model_copy(
        update={"settings_deg": KNOWN, "iterations": 1, "exploration": {boards.TURN: 5.0}}
    )
    board = boards.MadeUpBoard(**vars(small_board()) | {"setting_deg": NEW})
    data = boards.DATASETS[boards.TURN]

    def learn(dataset):
        write_table(to_table(dataset), tmp_path / f"{boards.TURN}.parquet")
        read = read_datasets(tmp_path, KNOWN)
        before, after, _ = refine_on_board(board, read, parameters)
        return before, after

    return Case(learn, data, corrected(data, data.setting == NEW), corrected(data, data.setting == KNOWN[0]))


OWN_FEEDBACK = TaskFeedbackParameters.model_validate(
    read_yaml(TASK_FILE)["defaults"]["movement"]["feedback"]
    | {"executions": "runs", "corrections": "corrected", "settings": ("a", "b"), "primitives": ("scrape",)}
    | {"axes": ("x",), "hidden": (4,), "training": TRAINING}
)


def felt(demonstration: Demonstration, push: float = 0.0) -> Demonstration:
    """What five channels feel on the way, and a correction sideways that is felt too."""
    s = np.linspace(0.0, 1.0, len(demonstration.time))
    bump = push * np.sin(np.pi * s) ** 2
    tactile = 40.0 * np.sin(np.outer(s, 1.0 + np.arange(5))) + 2e3 * bump[:, None]
    return replace(
        demonstration, position=demonstration.position + bump[:, None] * [1, 0, 0], tactile=tactile
    )


@of_stage("tasks/feedback", fits="feedback_learning._trained")
def feedback_of_a_task(monkeypatch, tmp_path):
    """The final network and one that was learned without a setting, of one axis."""
    runs = [felt(one) for one in demonstrations()]
    learned = fitting.learn_sequence(runs, cut(runs, CUTTING).results, FIT)
    pushes = {"a": 0.01, "b": 0.02, "only tests": 0.03}

    def corrections(changed=""):
        return {
            label: [
                felt(one, push * (1.3 if label == changed else 1.0)) for one in demonstrations((1.0, 1.1))
            ]
            for label, push in pushes.items()
        }

    learn = each(
        monkeypatch,
        feedback_learning,
        "_trained",
        lambda its: feedback_learning.learn_feedback(runs, its, learned, CUTTING, OWN_FEEDBACK),
    )
    data, trained_on = corrections(), corrections("b")
    for network, left_out in enumerate(("only tests", "a")):
        yield Case(lambda its, network=network: learn(its)[network], data, corrections(left_out), trained_on)


@of_stage("tasks/feedback")
def uncorrected_executions(monkeypatch, tmp_path):
    """Every other execution only tests the networks that were learned without a setting."""
    data, level = toy_dataset(settings=KNOWN), toy_dataset(settings=(0.0,), seed=1)
    data = replace(data, setting=np.where(data.setting == KNOWN[0], "a", "b"))
    level = replace(
        level, setting=np.full(len(level.target), feedback_learning.LEVEL), target=0 * level.target
    )
    odd = level.demonstration % 2 == 1
    learn = each(
        monkeypatch,
        feedback_learning,
        "_trained",
        lambda its: feedback_learning._learned({"scrape": {"x": data}}, {"scrape": its}, OWN_FEEDBACK),
    )
    changed = [with_wobbling(level, rows, "deviation") for rows in (odd, ~odd)]
    return Case(lambda its: learn(its)[1:], level, *changed)


# --- obstacles ---------------------------------------------------------------------------------------------


@of_stage("obstacles/dataset", fits="avoidance_scores.person_data")
def unhindered_reach(monkeypatch, tmp_path):
    """The baseline knows of no reach past an obstacle."""
    scene = committed(SceneParameters, "obstacle_scene", settings=1)
    person = committed(AvoiderParameters, "obstacle_demonstrator", count=2, baseline_count=3)
    parameters = committed(AvoidanceDataParameters, "obstacle_dataset")
    sets = [avoidance_scores.demonstrations(place, scene, person) for place in (None, *scenarios(scene))]

    def learn(data):
        recorded = iter(data)
        monkeypatch.setattr(avoidance_scores, "read_runs", lambda _: next(recorded))
        return avoidance_scores.person_data(person.seed, tmp_path, scene, person, parameters)[0]

    return Case(learn, sets, [sets[0], *(moved(its, 0) for its in sets[1:])], [moved(sets[0], 0), *sets[1:]])


@of_stage("obstacles/train", fits="avoidance_fits.learn_avoidance learned_models.train_phase_modulated")
def avoidance(monkeypatch, tmp_path):
    """Networks and ensembles, of each setting, each shape and all; Rai et al.; phase-modulated ones."""
    data = toy_reaches(scenarios=len(SCENARIOS), samples=20)
    held = held_out_rows(data, AVOIDANCE.split)

    def learn(dataset):
        return avoidance_fits.learn_avoidance({7: dataset}, SCENARIOS, AVOIDANCE, modulated=7)[0]

    tested = with_wobbling(data, held, "features", "target")
    return Case(learn, data, tested, with_wobbling(data, ~held, "target"))


@of_stage("recorded/coupling", fits="coupling._fitted coupling._ridge")
def coupling_of_samples(monkeypatch, tmp_path):
    """Every representation on the second block."""
    network = {"hidden": (4,), "members": 2, "training": {"iterations": 2}}
    parameters = committed_entry(
        "avoidance",
        folds=2,
        network=network,
        pmnn=TRAINING,
        pmnn_hidden=(4,),
    )
    learn = each(
        monkeypatch,
        coupling_representations,
        "_fitted",
        lambda its: coupling_representations.representation_scores(its, parameters),
    )
    data = phase_dependent(100)
    tested, trained_on = (
        with_wobbling(data, rows, "features", "target") for rows in (slice(50, None), slice(0, 1))
    )
    return Case(lambda its: learn(its)[1::2], data, tested, trained_on)


@of_stage("tasks/obstacles", fits="obstacles.judge_folds")
def reaches_past_boxes(monkeypatch, tmp_path):
    """Of three people, on one of whom constants were chosen: what was learned without the second."""
    boxes = test_tasks_obstacles

    def trials(changed=None):
        return [
            boxes.made_up_trial(f"p{place}", number, bow + 0.02 * (place == changed), x=x)
            for place in range(3)
            for number, (bow, x) in enumerate(((0.12, 0.0), (0.01, -0.2)))
        ]

    learn = each(
        monkeypatch,
        scene_models,
        "learn_scene_models",
        lambda its: learn_past_obstacles(its, boxes.PARAMETERS),
    )
    return Case(lambda its: learn(its)[0][0], trials(), trials(1), trials(2))


# --- dynamics ----------------------------------------------------------------------------------------------

LEARNING = committed(LearningParameters, "train_dynamics.learning", hidden=(4, 4))


def pushed(motion: Motion, rows: slice) -> Motion:
    """Other torques in some of the motion."""
    return with_wobbling(motion, rows, "torque")


@of_stage("dynamics/train", fits="trainings._train_together trainings._train_one")
def dynamics(monkeypatch, tmp_path):
    """Models of the arm and of one robot, beside the log of another robot."""
    parameters = committed(
        DynamicsTrainingParameters,
        "train_dynamics",
        models=("mlp", "mlp_scaled", "delan", "nostr", "cov"),
        seeds=(3,),
        epochs=EpochLimits(simulation=1, robot=1),
        learning=LEARNING,
    )
    motion = motion_with_friction(arm()).part(slice(0, 300))
    data = {
        "iiwa": sine_motion(arm(), 200),
        "perturbed/11": motion,
        "perturbed/12": motion.part(slice(100, 300)),
    }

    def learn(motions):
        models = train_all(trainings((11, 12), parameters), motions, arm().tree, parameters)[0]
        return {name: its for name, its in models.items() if "/12/" not in name}

    changed = [data | {name: pushed(data[name], slice(None))} for name in ("perturbed/12", "perturbed/11")]
    return Case(learn, data, *changed)


@of_stage("dynamics/online")
def payload(monkeypatch, tmp_path):
    """The empty arm, and what it seems to carry until something is picked up."""
    parameters = committed(
        PayloadLearningParameters, "online.payload", empty_s=10.0, batch=100, memory_s=2.0, iterations=5
    )
    data, dt, picked = motion_with_friction(arm()).part(slice(0, 900)), 0.02, 500

    def learn(motion):
        found = learn_payload((motion, dt), arm().tree, arm().inertias, parameters)
        before = found["time_s"] <= picked * dt
        return found.loc[before, ["mass_kg", "moment_x_kg_m", "moment_y_kg_m", "moment_z_kg_m"]]

    return Case(learn, data, pushed(data, slice(picked, None)), pushed(data, slice(0, 1)))


def learned_motion(folder: Path, robot, logs, parameters):
    """What is learned from logs, and torques that it predicts, apart from errors on what is held out."""
    source, target = folder / "arm.urdf", folder / "out"
    source.write_text(test_task_motion.ARM)
    target.mkdir(exist_ok=True)
    models, tables = learn_motion(robot, {log.name: log for log in logs}, parameters, source, target)
    learned = [tables[name] for name in ("base", "gravity", "choice", "gains", "bodies") if name in tables]
    learned.append(tables["traces"].drop(columns="measured"))  # least squares' too, which is no model
    if "carried" in tables:
        carried = tables["carried"]
        learned.append(carried.loc[carried["stage"] == LEARNED, ["mass_kg", "moment_x_kg_m"]])
    return models, learned, (target / "identified.urdf").read_text()


@of_stage(
    "tasks/motion",
    fits="model_comparison.identify_arm model_comparison._learned motion.fitness_tables motion.gravity_check",
)
def arms(monkeypatch, tmp_path):
    """Of the last log, and of the rest of a single one; a filter would reach over borders."""
    own = test_task_motion
    robot = own.arm()[0]
    networks = {"hidden": [[4]], "rates": [0.01], "epochs": [1], "choice_seeds": 1, "seeds": 1}
    networks |= {"train_share": 0.5, "batch": 64, "second_moment_decay": 0.99}
    quick = {"iterations": 3, "networks": networks, "rate_hz": 100.0, "smoothing_hz": 50.0}
    parameters = own.parameters(**quick)
    data = [own.made_up_log(robot, f"log {seed}", seed, seconds=8.0) for seed in range(2)]
    changed = [swapped(data, place, with_wobbling(data[place], slice(None), "torques")) for place in (1, 0)]
    yield Case(lambda logs: learned_motion(tmp_path, robot, logs, parameters), data, *changed)
    share = own.parameters(**quick, train_share=0.6, rest_rad_s=None)
    end = round(0.6 * len(data[0].stamps))
    changed = [[with_wobbling(data[0], rows, "torques")] for rows in (slice(end, None), slice(300, 301))]
    yield Case(lambda logs: learned_motion(tmp_path, robot, logs, share), data[:1], *changed)


@of_stage("tasks/motion", fits="drives_and_load._followed")
def ur10e(monkeypatch, tmp_path):
    """Logs at rest, learned from, asked about and with the load, on a small arm."""
    own = test_task_motion
    robot = own.arm()[0]
    parameters = committed_entry(
        "ur10e",
        train="train",
        test="test",
        rate_hz=50.0,
        iterations=3,
        body_draws=3,
        draws=100,
        networks={"hidden": [[4]], "rates": [0.01], "epochs": [1], "choice_seeds": 1, "seeds": 1},
        drives={
            "rest": "rest",
            "quoted_gains": (10.0, 11.0, 12.0),
            "delays_s": (0.0, 0.02),
            "delay_step_s": 0.01,
        },
        load={"pairs": (("train", "trainLoad"),), "batch": 200, "iterations": 3},
    )
    none = parameters.drives.model_copy(update={"assumed_gains": {}})
    parameters = parameters.model_copy(update={"drives": none})

    def drives(name, seed):
        log = own.made_up_log(robot, name, seed, seconds=8.0)
        columns = [1 + own.JOINTS[::-1].index(joint) for joint in own.JOINTS]
        q, qd, torque = (values[:, columns] for values in (log.positions, log.velocities, log.torques))
        if name == "rest":
            q, qd, torque = 0.0 * q, 0.0 * qd, np.linspace(0.5, 1.5, len(q))[:, None] + 0.0 * q
        return DriveLog(name, own.JOINTS, log.stamps, q, qd, torque / 10.0, torque / 10.0, torque)

    data = {name: drives(name, seed) for seed, name in enumerate(("rest", "train", "test", "trainLoad"))}
    columns = ("currents", "desired_currents", "target_torques")

    def changed(*names):
        return data | {name: with_wobbling(data[name], slice(None), *columns) for name in names}

    def learn(logs):
        return learned_motion(tmp_path, robot, logs.values(), parameters)

    return Case(learn, data, changed("test", "trainLoad"), changed("train"))


@of_stage("tasks/motion", fits="motion._tried")
def settings_of_networks(monkeypatch, tmp_path):
    """The end of the training motion chooses among networks of its start."""
    parameters = NetworkChoiceParameters(
        **{"train_share": 0.5, "hidden": ((4,),), "rates": (0.01, 0.02), "epochs": (1,), "batch": 32},
        **{"second_moment_decay": 0.99, "choice_seeds": 1, "seeds": 1},
    )
    tree, data = arm().tree, motion_with_friction(arm()).part(slice(0, 100))
    learn = each(
        monkeypatch,
        motion_learning,
        "DynamicsModels",
        lambda its: choose_networks(tree, its, parameters),
    )
    return Case(learn, data, pushed(data, slice(50, None)), pushed(data, slice(0, 1)))


@of_stage("recorded/parts", fits="parts.learn_parts parts.learned_networks")
def parts_of_torques(monkeypatch, tmp_path):
    """Networks and planar arms, of the authors' choice of logs and of a random one."""
    toy = test_torque_parts
    quick = {"left_out": ("p",), "seeds": 2, "splits": 2, "epochs": 1, "batch": 64}
    quick |= {"hidden": {"mlp": (4,), "delan": (4,)}}
    quick["published"] = dict.fromkeys(("torque", "coriolis", "inertial", "gravity", "power"), 1e-3)
    parameters = committed_entry("delan_characters", **quick)
    data = {name: toy.log(name, seed) for seed, name in enumerate("pqr")}
    (*_, (left_out,)) = torque_parts.characters_left_out(list(data), parameters)[2]

    def run(logs):
        return torque_parts.learn_parts(logs, parameters)

    changed = {
        name: data | {name: with_wobbling(its, slice(None), "positions", "torques")}
        for name, its in data.items()
    }

    networks = each(monkeypatch, torque_parts, "learned_networks", run)
    arms = each(monkeypatch, torque_parts, "fit_planar_arm", networks)
    for choice, fit, apart in ((0, 0, "p"), (2, 1, left_out)):  # planar arms have no seeds
        other = next(name for name in data if name != apart)
        for learned in (
            lambda logs, fit=fit: arms(logs)[fit],
            lambda logs, choice=choice: [of_kind[choice] for of_kind in networks(logs)],
        ):
            yield Case(learned, data, changed[apart], changed[other])


# --- touch -------------------------------------------------------------------------------------------------

LATENT = committed(
    LatentParameters,
    "train_latent",
    seeds=1,
    starts=1,
    stacks=1,
    training={"steps": 4, "evaluate_every": 4, "batch_size": 8},
    pair_pool=200,
    evaluation_pairs=50,
    longest_chain=3,
)
READINGS = ("signals", "pressure", "velocity")


def of_comparison(found: latent_comparison.LatentComparison) -> tuple:
    return found.models, found.units


@of_stage(
    "servoing/train_latent",
    "servoing/other_skins",
    fits="latent_comparison._learned latent_training.best_start",
)
def latent_spaces(monkeypatch, tmp_path):
    """Spaces, forward and inverse models, and the units they see touch in."""
    data = toy_touches(contacts=10, samples=200)
    geodesics = toy_geodesics(data, bins=1, size=800)
    return Case(
        lambda its: of_comparison(latent_comparison.learn_latent_spaces(its, geodesics, LATENT)),
        data,
        with_wobbling(data, data.split != TRAIN, *READINGS),
        with_wobbling(data, data.split == TRAIN, *READINGS),
    )


@of_stage(
    "recorded/transfer",
    fits="transfer._errors transfer._components latent_training.learn_spaces latent_training.learn_from",
)
def recorded_touch(monkeypatch, tmp_path):
    """What was learned of three slides while the first was held out, and its units."""
    toy = test_touch_transfer
    data = [toy.touch_set(name, 4, seed) for seed, name in enumerate((toy.SLIDES, toy.MAGNITUDES))]

    def changed(trial):
        slides = data[0]
        samples = with_wobbling(slides.samples, slides.samples.trial == trial, *READINGS)
        return [replace(slides, samples=samples), data[1]]

    def learn(sets):
        return touch_transfer.learn_transfer(sets, toy.FEW)

    names = ("learn_spaces", "own_units", "_components")
    fitted = [each(monkeypatch, touch_transfer, name, learn) for name in names]
    sets = data, changed(0), changed(1)
    return [Case(lambda its, learned=learned: learned(its)[0], *sets) for learned in fitted]


SKIN = committed_entry(
    "eflesh",
    tuned_on=["a"],
    block_mm=3.0,
    folds=2,
    copies=2,
    rival_samples=20,
    spaces={
        "seeds": 1,
        "pair_pool": 100,
        "evaluation_pairs": 50,
        "training": {"steps": 4, "evaluate_every": 4},
    },
    servo={"walks": 50, "trials": 2, "steps": 2},
)


@of_stage("tasks/touch", fits="touch._whole skin_readings.place_errors skin_touches.learn_skin")
def recorded_skin(monkeypatch, tmp_path):
    """Of one run: without the blocks of a fold, and of the whole beside another run."""
    toy = test_touch_skin
    data = [toy.toy_run("a", 1, depth_mm=1.0, size=7), toy.toy_run("b", 2, size=7)]
    fold = held_out(data[0].place[:, :2], 1e-3 * SKIN.block_mm, SKIN.folds)[1]

    def changed(run, rows):
        return swapped(data, run, with_wobbling(data[run], rows, "counts"))

    learn = each(
        monkeypatch, skin_readings, "learn_skin", lambda logs: touch_learning.learn_touch(logs, SKIN)
    )
    whole = each(monkeypatch, touch_learning, "learn_skin", learn)
    one_block = changed(0, fold == 0)
    yield Case(lambda its: whole(its)[0], data, changed(1, slice(None)), one_block)
    yield Case(lambda its: learn(its)[0], data, one_block, changed(0, fold == 1))


@of_stage("tasks/touch", fits="skin_readings.readings skin_readings.polynomial")
def readings_of_a_skin(monkeypatch, tmp_path):
    """What all models read from touches known to them, beside others: of a fold and of another run."""
    toy, real, known = test_touch_skin, skin_readings.readings, []
    monkeypatch.setattr(skin_readings, "TUNING_SAMPLES", 20)

    def remembered(learned, training, asked):
        run, rows = training
        both = zip(*(vars(its).values() for its in (run.skin(rows), asked)), strict=True)
        beside = real(learned, training, PressedSkin(*map(np.concatenate, both)))
        known.append([[its[: len(rows)] for _, its in arrays(one) if np.ndim(its)] for one in beside])
        return real(learned, training, asked)

    monkeypatch.setattr(skin_readings, "readings", remembered)
    data = [toy.toy_run("a", 1, depth_mm=1.0, size=7), toy.toy_run("b", 2, size=7)]
    fold = held_out(data[0].place[:, :2], 1e-3 * SKIN.block_mm, SKIN.folds)[1]
    first = toy.touches(data[0], SKIN)
    spaces = learn_skin(first, np.full(len(first.counts), True), with_dynamics=False)

    def learn(logs, of_fold):
        run, other = (toy.touches(log, SKIN) for log in logs)
        with one_thread():
            skin_readings.place_errors((spaces, run, 1 if of_fold else other))
        return known.pop()

    def changed(run, rows):
        return swapped(data, run, with_wobbling(data[run], rows, "counts"))

    trained_on = changed(0, fold == 0)
    yield Case(partial(learn, of_fold=True), data, changed(0, fold == 1), trained_on)
    yield Case(partial(learn, of_fold=False), data, changed(1, slice(None)), trained_on)


def few_channels(log: TouchLog) -> TouchLog:
    return replace(log, channels=log.channels[:3], counts=log.counts[:, :3])


@of_stage(
    "tasks/touch",
    fits="skin_within_runs._end_errors skin_readings.gaussian_process skin_within_runs.authors_network",
)
def end_of_a_run(monkeypatch, tmp_path):
    """Processes of a run's start, and among them those of its first part, by which inputs are chosen."""
    monkeypatch.setattr(skin_readings, "TUNING_SAMPLES", 20)
    share, whole = 0.8, few_channels(test_touch_skin.toy_strokes("a", presses=1))
    kept = np.flatnonzero(np.isfinite(whole.force))
    end = round(share * len(kept))
    inner = round((1.0 - (1.0 - share) / share) * end)
    published = SKIN.published.model_copy(update={"first_share": share, "epochs": 1})
    process = each(
        monkeypatch,
        skin_within_runs,
        "gaussian_process",
        lambda log: skin_within_runs.within_runs([log], published),
    )
    network = each(monkeypatch, skin_within_runs, "authors_network", process)

    def changed(first, last=None):
        return with_wobbling(
            whole, slice(kept[first], None if last is None else kept[last]), "counts", "force"
        )

    trained_on = changed(9, 12)
    yield Case(network, whole, changed(end), trained_on)
    yield Case(process, whole, changed(end), trained_on)
    yield Case(lambda log: process(log)[:-1], whole, changed(inner, end), trained_on)


@of_stage("tasks/touch", fits="skin_force._models skin_force._process")
def forces(monkeypatch, tmp_path):
    """Without one press, which also changes no lag; and of a whole recording beside another one."""
    monkeypatch.setattr(skin_readings, "TUNING_SAMPLES", 20)
    parameters, presses = SKIN.force.model_copy(update={"longest_lag_s": 0.8, "penalties": (0.1,)}), 4
    strokes = test_touch_skin.toy_strokes
    data = [few_channels(strokes(name, presses, gain)) for name, gain in (("a", 1.0), ("b", 1.1))]
    models = each(monkeypatch, skin_force, "_models", lambda its: skin_force.force_errors(its, parameters, 9))
    process = each(monkeypatch, skin_force, "_process", models)

    def changed(run, *pressed):
        time = data[run].time
        rows = np.isin(time // 20.0, pressed) & (np.abs(time % 20.0 - 10.0) < 6.0)
        return swapped(data, run, with_wobbling(data[run], rows, "counts", "force"))

    other, one, trained_on = changed(1, *range(presses)), changed(0, LEFT_OUT), changed(0, ANOTHER)
    yield Case(lambda its: process(its)[0], data, other, trained_on)
    yield Case(lambda its: models(its)[presses], data, other, trained_on)
    yield Case(lambda its: models(its)[LEFT_OUT], data, one, trained_on)


@of_stage("tasks/touch", fits="skin_force._quadratic")
def penalty_of_forces(monkeypatch, tmp_path):
    """Presses that choose the penalty, every third, train nothing that they choose among."""
    rng, press = np.random.default_rng(0), np.repeat(np.arange(6), 8)
    data = skin_force.WeighedPresses(np.arange(48.0), rng.normal(size=(48, 3)), rng.normal(size=48), press)
    learn = each(
        monkeypatch, sklearn.linear_model, "Ridge", lambda its: skin_force._quadratic(its, (0.1, 1.0))
    )

    def changed(rows):
        return data._replace(channels=wobbling(data.channels, rows), force=wobbling(data.force, rows))

    return Case(lambda its: learn(its)[0], data, changed(press % 3 == 0), changed(press == 1))


# --- the tests ---------------------------------------------------------------------------------------------


def arrays(models: Any, name: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """Every array and number in models, by where it is; also those that a function encloses."""
    if isinstance(models, torch.Tensor):
        yield name, models.detach().numpy()
    elif models is None or isinstance(models, np.ndarray | np.generic | str | int | float):
        yield name, np.asarray(models)
    elif isinstance(models, pd.DataFrame):
        yield from arrays(dict(models.items()), name)
    elif isinstance(models, pd.Series):
        yield name, models.to_numpy()
    elif isinstance(models, Mapping):
        for key, value in models.items():
            yield from arrays(value, f"{name}/{key}")
    elif isinstance(models, list | tuple):
        yield from arrays(dict(enumerate(models)), name)
    elif isinstance(models, MethodType):
        yield from arrays(models.__self__, name)
    elif isinstance(models, FunctionType):
        inside = inspect.getclosurevars(models).nonlocals
        yield from arrays(inside, name)
    elif isinstance(models, np.random.RandomState):
        yield from arrays(models.get_state(), name)
    elif hasattr(models, "to_arrays"):
        yield from arrays(models.to_arrays(), name)
    elif hasattr(models, "__dict__"):
        yield from arrays(vars(models), name)
    else:
        raise TypeError(f"{name}: nothing is compared of {type(models)}")


def bits(models: Any) -> dict[str, bytes]:
    found = {
        name: repr((values.dtype, values.shape)).encode() + contents(values)
        for name, values in arrays(models)
    }
    assert len(found) > 0
    return found


def contents(values: np.ndarray) -> bytes:
    return repr(values.tolist()).encode() if values.dtype == object else values.tobytes()


@pytest.mark.parametrize(
    "make", list(dict.fromkeys(make for _, make in CASES)), ids=lambda make: make.__name__
)
def test_what_is_held_out_trains_nothing(make, monkeypatch, tmp_path):
    monkeypatch.setenv(BACKEND, "sequential")
    with threadpool_limits(1):  # of small arrays threads take longer
        found = make(monkeypatch, tmp_path)
        for case in [found] if isinstance(found, Case) else found:
            before = bits(case.learn(case.data))
            after = bits(case.learn(case.held_out))
            assert [name for name, values in before.items() if after[name] != values] == []
            assert bits(case.learn(case.trained_on)) != before


def stage_scripts() -> dict[str, Path]:
    """Scripts of all pipelines by folder and name, e.g. `scraping/refine`."""
    found = {}
    for path in (ROOT / "dvc.yaml", *sorted(ROOT.glob("stages/*/dvc.yaml"))):
        for stage in read_yaml(path)["stages"].values():
            command = stage.get("do", stage)["cmd"]
            (name,) = re.findall(r"stages/(\S+)\.py", command)
            found[name] = ROOT / f"stages/{name}.py"
    return found


def test_every_stage_that_learns_has_a_case():
    """A new stage gets one, or a line that says why it holds nothing out."""
    scripts = {*stage_scripts(), *(f"tasks/{one.stem}" for one in STAGES.glob("[a-z]*.py"))} - {"tasks/learn"}
    scripts |= {f"recorded/{one.stem}" for one in (ROOT / "stages/recorded").glob("*.py")}
    for place, kinds in (("tasks", STAGES.parent), ("recorded", SETS)):  # which runs one of these
        scripts |= {f"{place}/{one.parent.name}" for one in kinds.glob("*/learning.py")}
    cases, others = {stage for stage, _ in CASES}, {*" ".join(HOLDS_NOTHING_OUT.values()).split()}
    assert {name for name in scripts if not name.endswith(SHOWS)} == cases | others
    assert not cases & others


def fitting_functions() -> set[str]:
    """Functions (`module.name`) that call what fits, where something can be held out."""
    found = set()
    for path in sorted(SOURCES.rglob("*.py")):
        house, *parts = path.relative_to(SOURCES).with_suffix("").parts
        if any(re.fullmatch(DRAWS, part) for part in parts):
            continue
        tree = ast.parse(path.read_text())
        words = {getattr(node, "id", None) or getattr(node, "arg", None) or "" for node in ast.walk(tree)}
        if (
            house == "dissertation"
            or parts[0] == "tasks"
            or any(re.fullmatch(SEPARATES, word) for word in words)
        ):
            functions = (node for node in tree.body if isinstance(node, ast.FunctionDef))
            place = parts[-2] if parts[-1] == "learning" else parts[-1]  # of a kind of tasks
            found |= {f"{place}.{one.name}" for one in functions if any(map(fits, ast.walk(one)))}
    return found


def fits(node: ast.AST) -> bool:
    called = getattr(node, "func", None)
    name = getattr(called, "attr", None) or getattr(called, "id", "")
    return re.fullmatch(LEARNERS, name) is not None


def test_every_fit_has_a_case():
    """A stage may hold out several things: every function that fits one is compared, or says why not."""
    others = {*" ".join(FITS_ALL.values()).split()}
    assert fitting_functions() == FITS.keys() | others
    assert not FITS.keys() & others
