"""Sentences on the dynamics testbed; their numbers follow from the results."""

import numpy as np

from structlearn.reporting.prose import counted, listing, rounded, with_spread
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, NAMES, model_name
from structlearn.testbeds.dynamics.page.dynamics_published import SIMULATION
from structlearn.testbeds.dynamics.page.dynamics_results import (
    IDEAL,
    REACH,
    ROBOT,
    SETTLED_SHARE,
    SINE,
    STOPPED_NMSE,
    DynamicsResults,
)
from structlearn.testbeds.dynamics.page.dynamics_tables import base_errors, bodies

TERM_NAMES = {"viscous": "viscous", "coulomb": "Coulomb"}


def what(results: DynamicsResults) -> str:
    """What is learned, from what."""
    motion = results.motion
    return (
        f"An arm in PyBullet swings along a sine in every joint at once for {motion.duration_s:g} s, logged "
        f"at {motion.rate_hz:g} Hz. From positions, velocities and accelerations models learn the torques: "
        "MLP knows nothing, DeLaN knows that a Lagrangian is behind them, and the five structures know the "
        "arm's kinematics and learn masses, centres of mass and inertias of its links by Newton-Euler. They "
        "differ in what inertia may be: nine free numbers (NoStr), symmetric (Symm), positive definite "
        "(SPD), or that of a body that can exist (Tri, Cov). “MLP, scaled” is not in the dissertation: its "
        "inputs and outputs are standardised."
    )


def robot(results: DynamicsResults) -> str:
    """What stands in for the dissertation's robot."""
    its = results.stand_in
    if its is None:
        return (
            "The robot's log is your own (`record_motion.source`): there is no true model of it, and it "
            "cannot be tracked with."
        )
    return (
        "The dissertation's robot is not at hand. A simulated stand-in has what a model of the URDF lacks: "
        f"viscous friction of {100 * its.viscous_share:g} % of a drive's rated torque per rad/s, Coulomb "
        f"friction of {100 * its.coulomb_share:g} %, torque ripple of {100 * its.ripple_share:g} %, noise of "
        f"{100 * its.noise_share:g} %, {counted(its.latency_ticks, 'tick')} of latency, masses that are off "
        f"by {100 * its.mass_spread:g} % (std of their logarithm) and centres of mass by "
        f"{100 * its.centre_spread_m:g} cm per axis. A log of your own robot can take its place. What real "
        "torques make of the same models is on the page of recorded data, with a Franka Panda."
    )


def losses(results: DynamicsResults) -> str:
    """Why the losses differ, and what the optimiser does."""
    learning, plain = results.training.learning, results.training.plain
    last = results.errors["joint"].max()
    rows = results.outcome(IDEAL, "cov", "raw")
    known = rows["epochs_but_last"].dropna()
    but_last = f" (Cov: {known.mean():.1f} on average without it)" if len(known) else ""
    return (
        f"A model is good enough when its NMSE is {learning.threshold:g} or lower on every joint. With the "
        f"raw loss of the text (eq. III.2) joint {last} decides: its torque varies so little beside the "
        f"others' that the loss hardly sees it{but_last}. Normalised by each joint's variance, all count "
        f"alike.{_networks_but_last(results, last)} The text does not name its optimiser. Here it is Adam "
        "with a rate that falls and a larger step for masses for the structures; the last column has Adam "
        f"as it comes (rate {plain.rate:g}, batches of {plain.batch})."
    )


def _networks_but_last(results: DynamicsResults, last: int) -> str:
    """When the text's networks are good enough with the raw loss, were it not for the last joint."""
    told = []
    for kind in ("delan", "mlp"):
        rows = results.outcome(IDEAL, kind, "raw")
        if len(rows) and rows["epochs_but_last"].notna().all():
            found = with_spread(rows["epochs_but_last"].mean(), rows["epochs_but_last"].std(), ".0f")
            told.append(
                f"{NAMES[kind]} needs {found} epochs (published for all joints: {SIMULATION[kind].epochs})"
            )
    return f" Without joint {last}, {' and '.join(told)}." if told else ""


def tracking(results: DynamicsResults) -> str:
    """What the tasks are and how runs are scored."""
    reaching = results.tracking.reaching
    stopped = [
        f"{model_name(model)} {count}"
        for model in results.tracked(IDEAL)
        if (count := results.stopped(IDEAL, model))
    ]
    found = f"Stopped here: {', '.join(stopped)}." if stopped else "No run had to be stopped here."
    return (
        f"The models as they were when they became good enough, with the {results.loss} loss, take turns in "
        f"the controller: along the sines, and in {reaching.goals} reaches to random goals by velocity-based "
        "operational-space control. Both have a linear feedback that is the same for all models; the better "
        "the model, the less it has to do. Errors are normalised by the variance of what was wanted. A run "
        "in which a joint gets too fast, leaves its range, or gets torques that are no numbers is stopped as "
        f"a robot would stop it; it counts as far as it went, but at least {STOPPED_NMSE:g}, the error of an "
        f"arm that does not move. {found}"
    )


def online(results: DynamicsResults) -> str:
    """What figure III.2 shows here."""
    final = results.online_scores()["final"].groupby(level="model").mean().sort_values()
    best, worst = final.index[0], final.index[-1]
    learning = results.learning_online.learning
    return (
        f"Models go through the motion once, in its order, {learning.structures.batch} samples a step, and "
        "are tested on all of it after every step. What comes later is new to them: an arm that has moved "
        "little so far does not show what it weighs elsewhere. After one pass with the "
        f"{results.loss} loss {NAMES[best]} is best ({final[best]:.2g}) and {NAMES[worst]} worst "
        f"({final[worst]:.2g})."
    )


def bodies_found(results: DynamicsResults) -> str:
    """Whether learned bodies can exist, and whether they are those of the robot."""
    table = bodies(results).set_index("model")
    impossible = {
        model: int(row["links"] - row["possible"])
        for model, row in table.iterrows()
        if row["possible"] < row["links"]
    }
    parts = [f"{model} {count} of {int(table.loc[model, 'links'])}" for model, count in impossible.items()]
    errors = base_errors(results).set_index("model")
    best = errors["base"].idxmin()
    count = results.base["parameter"].nunique()
    total = 10 * results.links["link"].nunique()
    return (
        f"Links that cannot exist, of all seeds: {', '.join(parts) if parts else 'none'}. Torques do not "
        f"show every parameter: of {total} only {count} combinations act, the base parameters. These are "
        f"what a good model has in common with the robot ({best}: median error "
        f"{100 * errors.loc[best, 'base']:.1f} %), while its masses may be others (median "
        f"error {100 * errors.loc[best, 'mass']:.0f} %) and "
        "predict the same torques. Training stops at the threshold: what hardly shows in the torques may "
        "still be as it was drawn."
    )


def robot_learning(results: DynamicsResults) -> str:
    """What the robot's log teaches."""
    default = results.robot_error(DEFAULT)
    parts = [f"NMSE, mean over joints: {default:.3f} with the default model"]
    for model in ("cov", f"cov{COULOMB}"):
        if model in results.robot_models:
            terms = "viscous and Coulomb" if model.endswith(COULOMB) else "viscous"
            parts.append(f"{results.robot_error(model):.3f} with Cov and {terms} friction")
    truth = results.known[results.known["model"] == GROUND_TRUTH]
    rest = (
        f" The true links and friction leave {truth['nmse'].mean():.4f}: ripple, noise and latency."
        if len(truth)
        else ""
    )
    return (
        f"All signals are low-passed at {results.training.smoothing_hz:g} Hz, and models get at most "
        f"{results.training.epochs.robot} epochs. {', '.join(parts)}.{rest}"
    )


def robot_tracking(results: DynamicsResults) -> str:
    """What becomes of it in the controller."""
    sentences = []
    for task, words in ((SINE, "sines"), (REACH, "reaches")):
        stopped = {
            model: int((results.runs(ROBOT, model, task)["stopped"] != "").sum())
            for model in results.tracked(ROBOT)
        }
        names = [f"{model_name(model)} ({count})" for model, count in stopped.items() if count]
        sentences.append(f"along {words}: {listing(names)}")
    return (
        "As in simulation, but with the stand-in's friction, ripple and latency, and the viscous friction "
        f"that models learned. Runs that had to be stopped, of {results.tracking.seeds} each, "
        f"{'; '.join(sentences)}."
    )


def friction(results: DynamicsResults) -> str:
    """How near learned friction is to what rubs."""
    its = results.friction[results.friction["model"] == f"cov{COULOMB}"]
    if its.empty or its["truth"].isna().all():
        return "The dissertation learns viscous friction and names static friction as future work."
    errors = {}
    for term, rows in its.groupby("term", sort=False):
        errors[term] = float(((rows["value"] - rows["truth"]).abs() / rows["truth"]).median())
    parts = [f"{TERM_NAMES[term]} {100 * error:.0f} %" for term, error in errors.items()]
    viscous = results.friction[results.friction["model"] == "cov"]
    factor = float((viscous["value"] / viscous["truth"]).median())
    return (
        "The dissertation learns viscous friction and names static friction as future work. With both terms, "
        f"median errors of the coefficients are: {', '.join(parts)}. Without the Coulomb term, the viscous "
        f"one stands in for it and becomes {factor:.1f} times too large (median)."
    )


def payload(results: DynamicsResults) -> str:
    """What is learned of the payload, how soon."""
    carried, settling = results.carried, results.settling_s
    rows = results.payload[results.payload["time_s"] > results.pick_up_s]
    fixed, learned = rows["nmse_fixed"].mean(), rows["nmse_learned"].mean()
    final = rows.iloc[-1]
    how = (
        f"its mass stays within {100 * SETTLED_SHARE:g} % after {settling:.1f} s"
        if settling is not None
        else f"its mass is not within {100 * SETTLED_SHARE:g} % in the end"
    )
    return (
        f"After {results.pick_up_s:g} s the arm takes hold of {carried.mass_kg:g} kg, "
        f"{np.linalg.norm(carried.point_m):g} m from its last joint's origin, which nobody tells the model. "
        f"Only the last link is learned, as {NAMES[results.learning_online.payload.structure]}, from what "
        f"the torques say, with a memory of {results.learning_online.payload.memory_s:g} s: {how}, and in "
        f"the end is {final['mass_kg']:.3f} kg. Every batch is predicted before it is learned from: NMSE "
        f"{fixed:.3g} with the model of the empty arm, {learned:.2g} with the learned one, from then on."
    )


def agreement(results: DynamicsResults) -> str:
    """What is compared, and what the worst is."""
    return (
        "Three ways to the same torques: the recursion by which gradients flow, the regressor that "
        "structures train on, and the compiled form that controls. At random states with the URDF's inertias "
        f"they differ from Pinocchio's `rnea` by at most {rounded(results.largest_disagreement, '.1e')} N m."
    )


def other_arms() -> str:
    """How another arm goes through the same stages."""
    return (
        "Any arm with a URDF goes the same way, e.g. a Franka Panda: `dvc exp run -S "
        "arm.urdf=franka_panda/panda.urdf -S "
        "'arm.locked_joints=[panda_finger_joint1,panda_finger_joint2]'`. Your robot's own log takes the "
        "place of the stand-in's with `-S record_motion.source=FILE.mcap`."
    )
