"""Closed-loop trials of all controllers, the same random trials for each so that they compare in pairs.

Published controllers are the dissertation's; adaptive controllers correct their model
(`tactile.servo_controller`). Both read the same electrodes and act at the same rate, which is higher than the
models' step rate; the dissertation states neither rate for run time.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np
import pandas as pd

from dissertation.servoing.protocol.servo_scores import THINNED, scored, servo_progress
from dissertation.servoing.protocol.servo_variants import (
    ALL_ALIKE,
    AS_DATA,
    DERIVATIVE,
    PUBLISHED,
    UNCORRECTED,
    OtherSkinsParameters,
    ServoTrialParameters,
    ServoVariant,
    SkinName,
)
from dissertation.servoing.world.servo_loop import (
    LoopParameters,
    Scene,
    Servoed,
    handle_of,
    press_skin,
    servo,
)
from dissertation.simulation.touch import FingerParameters, make_finger
from dissertation.simulation.touch_demonstrator import (
    SAMPLED_EVERY,
    ToucherParameters,
    covered,
    demonstrate,
    recorded,
)
from structlearn.core.parallel import parallel_map
from structlearn.readers.clock import synchronise
from structlearn.tactile.electrodes import SKINS
from structlearn.tactile.geodesics import geodesics
from structlearn.tactile.latent_comparison import LatentComparison, learn_latent_spaces
from structlearn.tactile.latent_models import TrainedTouch
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentParameters
from structlearn.tactile.servo_controller import AdaptiveServo, ModelTrust, ServoParameters, TactileServo
from structlearn.tactile.touch_dataset import TEST_STRIDE, TouchDataParameters, prepare

MOTIONS = ("rotation", "translation", "mixed")  # across the finger, along it, both


def compare_controllers(
    trained: TrainedTouch,
    person: ToucherParameters,
    finger: FingerParameters,
    parameters: ServoTrialParameters,
    chosen: Sequence[ServoVariant],
) -> dict[str, pd.DataFrame]:
    """Run several controllers on the same trials, within the region the person demonstrated.

    Returns tables keyed by name, with the columns of `ServoVariant`. `trials`: `seed`, `trial`, `motion`,
    contacts and latent states of start and target, and `servo_scores.scored`; `progress`: of
    `servo_scores.servo_progress`; `paths`: the first trials of every seed, see `_paths`.
    """
    run = partial(_run, trained=trained, person=person, finger=finger, parameters=parameters)
    results = parallel_map(run, chosen, "closed loops", local=True)
    return {name: pd.concat([its[name] for its in results], ignore_index=True) for name in results[0]}


def make_scene(
    person: ToucherParameters, finger: FingerParameters, parameters: ServoTrialParameters
) -> Scene:
    """Finger, handle and robot for closed-loop trials, as in the demonstrations."""
    skin = SKINS[person.skin]
    return Scene(
        finger=make_finger(finger, skin, person.sensor_seed, person.rate_hz / SAMPLED_EVERY),
        handle=handle_of(person),
        robot_hz=person.rate_hz,
        follow_s=parameters.follow_s,
        rest_s=parameters.rest_s,
    )


def draw(
    person: ToucherParameters, parameters: ServoTrialParameters, models: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Random trials on the demonstrated part of the skin, at demonstrated loads.

    Returns start and target, (B, 3) each: along and across the finger in m, load in N; and motion index (B,).
    """
    along, across = covered(person, SKINS[person.skin])
    light, firm = person.load_n
    low, high = (light + share * (firm - light) for share in parameters.load_share)
    count = models * parameters.trials
    start, target = (
        np.stack([rng.uniform(*ends, count) for ends in (along, across, (low, high))], axis=1)
        for _ in range(2)
    )
    motion = np.arange(count) % len(MOTIONS)
    for number, kept in ((MOTIONS.index("rotation"), 0), (MOTIONS.index("translation"), 1)):
        target[motion == number, kept] = start[motion == number, kept]
    return start, target, motion


def make_controller(
    variant: ServoVariant, trained: TrainedTouch, parameters: ServoTrialParameters, sample_hz: float
) -> tuple[TactileServo, LoopParameters]:
    """Controller with the models of all seeds, and its timing; electrodes are read at `sample_hz`."""
    form = parameters.published if variant.form == PUBLISHED else parameters.resting
    own = form.model_dump(include={"action_penalty", "gradient_gain", "largest_action"})
    servo_parameters = ServoParameters(
        inverse=variant.inverse, trained_with_inverse=variant.with_loss, horizon=variant.horizon, **own
    )
    loop = parameters.loop_of_data if variant.change == AS_DATA else parameters.loop
    # duration of one model step, even if actions are replaced more often
    steps = sample_hz / TEST_STRIDE, max(1, round(TEST_STRIDE / loop.samples_per_action))
    whole = (*trained, variant.structure, servo_parameters, *steps)
    if variant.form == PUBLISHED:
        return TactileServo(*whole), loop
    trust = ModelTrust(
        by_likelihood=variant.change != ALL_ALIKE,
        spread=0.0 if variant.change == DERIVATIVE else parameters.resting.spread,
        correction=0.0 if variant.change == UNCORRECTED else parameters.resting.correction,
    )
    return AdaptiveServo(*whole, trust), loop


def _run(
    variant: ServoVariant,
    trained: TrainedTouch,
    person: ToucherParameters,
    finger: FingerParameters,
    parameters: ServoTrialParameters,
) -> dict[str, pd.DataFrame]:
    """Tables of one controller; random draws are the same for all controllers."""
    rng = np.random.default_rng(parameters.seed)
    scene = make_scene(person, finger, parameters)
    models = len(trained.models.seeds)
    places, wanted, motion = draw(person, parameters, models, rng)
    tilt = np.radians(parameters.tilt_deg) * rng.standard_normal((2, len(places), 2))
    start, target = press_skin(places, tilt[0], scene, rng), press_skin(wanted, tilt[1], scene, rng)
    controller, loop = make_controller(variant, trained, parameters, scene.sample_hz)
    run = servo(controller, models, start, target, scene, loop, parameters.duration_s, rng)
    seed = np.repeat(trained.models.seeds, parameters.trials)
    number = np.tile(np.arange(parameters.trials), models)
    columns = {"seed": seed, "trial": number, "motion": np.array(MOTIONS)[motion]}
    for name, held in (("start", start), ("target", target)):
        columns |= {f"{name}_{axis}_m": held.contact.point[:, place] for place, axis in enumerate("xyz")}
        columns[f"{name}_load_n"] = held.contact.load
    columns |= {f"target_latent_{name}": run.target_latent[:, place] for place, name in enumerate("xyz")}
    trials = pd.DataFrame(columns).join(scored(run, start, target, scene, parameters.tolerance))
    plain = variant == ServoVariant(variant.form, variant.inverse)
    shown = np.flatnonzero(plain & (number < parameters.shown))
    tables = {
        "trials": trials,
        "progress": servo_progress(run, target, scene, parameters.tolerance),
        "paths": _paths(run, scene, shown, seed[shown], number[shown]),
    }
    for table in tables.values():
        for place, (key, value) in enumerate(vars(variant).items()):
            table.insert(place, key, value)
    return tables


def _paths(
    run: Servoed, scene: Scene, shown: np.ndarray, seed: np.ndarray, trial: np.ndarray
) -> pd.DataFrame:
    """Thinned paths of some trials, concatenated.

    Columns: `seed`, `trial`, `time_s`; finger pose in the base frame; true contact in the finger frame;
    latent state; `electrode_01` and so on, counts minus offset.
    """
    rows = slice(0, None, THINNED)
    steps = len(run.load[rows])
    electrodes = [f"electrode_{number + 1:02d}" for number in range(run.signals.shape[2])]
    values = {
        ("finger_x_m", "finger_y_m", "finger_z_m"): run.position,
        ("finger_qw", "finger_qx", "finger_qy", "finger_qz"): run.orientation,
        ("x_m", "y_m", "z_m"): run.point,
        ("load_n",): run.load[..., None],
        ("latent_x", "latent_y", "latent_z"): run.latent,
        tuple(electrodes): run.signals,
    }
    columns = {
        "seed": np.repeat(seed, steps),
        "trial": np.repeat(trial, steps),
        "time_s": np.tile((np.arange(steps) * THINNED + 1) / scene.sample_hz, len(shown)).astype(np.float32),
    }
    for names, found in values.items():
        flat = found[rows][:, shown].swapaxes(0, 1).reshape(-1, len(names)).astype(np.float32)
        columns |= dict(zip(names, flat.T, strict=True))
    return pd.DataFrame(columns)


def learn_other_skin(
    other: OtherSkinsParameters,
    person: ToucherParameters,
    finger: FingerParameters,
    preparation: TouchDataParameters,
    distances: GeodesicParameters,
    latent: LatentParameters,
    name: SkinName,
) -> LatentComparison:
    """Demonstrate and learn with a differently shaped finger by the same code, with fewer models.

    Tests the claim that the method does not assume the skin's geometry (II.5): distances on the skin come
    from neighbouring contact points, which are estimated from the electrodes.
    """
    person = other.person_with(name, person)
    recordings = [recorded(run, person) for run in demonstrate(person, finger)]
    demonstrations = [synchronise(one, preparation.rate_hz) for one in recordings]
    dataset = prepare(demonstrations, SKINS[name], preparation)
    measured = geodesics(dataset.contact_point, distances)
    training = latent.training.model_copy(update={"evaluate_every": latent.training.steps})
    fewer = {"seeds": other.seeds, "stacks": 1, "training": training}
    return learn_latent_spaces(dataset, measured, latent.model_copy(update=fewer))
