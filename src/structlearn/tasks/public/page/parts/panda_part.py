"""Inverse dynamics of a recorded arm: structures, friction and networks on motion not learned from."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.core.artefacts import Metrics
from structlearn.palette import BLACK
from structlearn.reporting.claims import Found, counted, exact, mean
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import styled
from structlearn.reporting.panels import legend, panel
from structlearn.rigid_body.model_names import STRICT
from structlearn.tasks.public import public_names
from structlearn.tasks.public.page.parts.part import Part, Pictures
from structlearn.tasks.public.page.recorded_results import AXES, RecordedResults
from structlearn.tasks.public.page.recorded_tables import shown

TEXT_STRUCTURES = ("symm", *STRICT)
"""Structures that table III.2 has."""

CONSISTENT = ("tri", "cov")
"""Structures of physically consistent inertias."""

TRACED_JOINTS = (5, 7, 1, 6)

TRACED = ("urdf", "mlp", "cov_viscous", "cov_coulomb")
"""Columns of torques that are drawn beside the measured ones."""


def errors_by_joint(errors: pd.DataFrame, part: str) -> pd.DataFrame:
    """NMSE on a part by model and friction, in their order, and joint; mean over seeds."""
    rows = errors[errors["part"] == part]
    wide = rows.pivot_table(index=["model", "friction"], columns="joint", values="nmse", sort=False)
    models, frictions = list(public_names.DYNAMICS_MODELS), list(public_names.FRICTIONS)
    keys = [(frictions.index(friction), models.index(model)) for model, friction in wide.index]
    return wide.iloc[sorted(range(len(keys)), key=keys.__getitem__)]


def panda_errors(results: RecordedResults, part: str = "test") -> pd.DataFrame:
    """NMSE on `test` or `train` by model and friction, in their order, and joint; mean over seeds."""
    return errors_by_joint(results["panda_errors"], part)


def metrics(results: RecordedResults) -> Metrics:
    """Means over the joints."""
    means = panda_errors(results).mean(axis=1)
    shown_models = (
        ("default", "urdf", "none"),
        ("least_squares_viscous", "least_squares", "viscous"),
        ("least_squares_coulomb", "least_squares", "coulomb"),
        ("cov_viscous", "cov", "viscous"),
        ("cov_coulomb", "cov", "coulomb"),
        ("mlp", "mlp", "none"),
    )
    return {f"panda_nmse_{name}": means[model, friction] for name, model, friction in shown_models}


def evidence(results: RecordedResults) -> dict[str, Found]:
    """By the names of the claims."""
    test = panda_errors(results)
    means = test.mean(axis=1)
    structures = [(model, "viscous") for model in TEXT_STRUCTURES]
    rows = results["panda_errors"][results["panda_errors"]["part"] == "test"]
    by_seed = rows.groupby(["model", "friction", "seed"])["nmse"].mean()
    better = test.loc[structures].max() < test.loc["urdf", "none"]
    last = test.columns[-1]
    with_coulomb = test.loc[[(model, "coulomb") for model in CONSISTENT]]
    return {
        "better_joints": counted(int(better.sum()), len(better)),
        "over_networks": {
            public_names.DYNAMICS_MODELS[key[0]]: mean(by_seed[key] - means[structures].max())
            for key in (("mlp", "none"), ("delan", "viscous"))
        },
        "coulomb_factor": {
            public_names.DYNAMICS_MODELS[model]: exact(
                means[model, "viscous"] / means[model, "coulomb"], len(better)
            )
            for model in STRICT
        },
        "over_least_squares": {
            public_names.FRICTIONS[friction]: exact(
                max(
                    (test.loc[model, friction] / test.loc["least_squares", friction]).max()
                    for model in CONSISTENT
                ),
                len(CONSISTENT) * len(better),
            )
            for friction in ("viscous", "coulomb", "offset")
            if ("least_squares", friction) in test.index
        },
        "coulomb_errors": {
            "joints 1 to 6": exact(with_coulomb.drop(columns=last).mean(axis=1).max(), len(CONSISTENT)),
            "joint 7": exact(with_coulomb[last].max(), len(CONSISTENT)),
        },
    }


def facts(results: RecordedResults) -> dict[str, object]:
    """Values for its sentences."""
    test, train = (panda_errors(results, part).mean(axis=1) for part in ("test", "train"))
    by_joint = panda_errors(results)
    keys = (
        ("mlp", "none"),
        ("mlp_scaled", "none"),
        ("delan", "viscous"),
        ("delan", "coulomb"),
        ("cov", "coulomb"),
    )
    return {
        "trained_and_tested": [
            f"{public_names.DYNAMICS_MODELS[key[0]]}{' + Coulomb' if key[1] == 'coulomb' else ''} "
            f"{train[key]:.2g} \N{RIGHTWARDS ARROW} {test[key]:.2g}"
            for key in keys
            if key in test.index
        ],
        "friction_factor": by_joint.loc["cov", "viscous"] / by_joint.loc["cov", "coulomb"],
        "test_s": np.ptp(results["panda_traces"]["time_s"]),
    }


def tables(results: RecordedResults) -> dict[str, Table]:
    """Tables keyed by name."""
    test = panda_errors(results)
    numbers = test.add_prefix("joint_").assign(mean=test.mean(axis=1))
    models = [public_names.DYNAMICS_MODELS[model] for model, _ in test.index]
    frictions = [public_names.FRICTIONS[friction] for _, friction in test.index]
    keys = pd.DataFrame({"model": models, "friction": frictions})
    plain = frozenset(np.flatnonzero(test.index.get_level_values("model") == "least_squares").tolist())
    rubbing = _of_cov(results["panda_friction"]).pivot_table(index="joint", columns="term", values="value")
    centre = [f"centre_{axis}_m" for axis in AXES]
    return {
        "panda": shown(pd.concat([keys, numbers.reset_index(drop=True)], axis=1), plain),
        "panda_rubbing": shown(rubbing.reset_index()[["joint", "viscous", "coulomb"]]),
        "panda_bodies": shown(_of_cov(results["panda_links"])[["link", "mass_kg", "true_mass_kg", *centre]]),
    }


def _of_cov(table: pd.DataFrame) -> pd.DataFrame:
    """Rows of the structure Cov with viscous and Coulomb friction."""
    return table[(table["model"] == "cov") & (table["friction"] == "coulomb")]


def pictures(results: RecordedResults) -> Pictures:
    """Figures keyed by name."""
    traces, words = results["panda_traces"], "Robot: joint {} of a Franka Panda"
    torques = [
        torque_panel(traces, joint, words.format(joint), "time of the test part (s)")
        for joint in TRACED_JOINTS
    ]
    return {
        "panda_motion": torques[0],
        "panda": [joint_errors_panel(panda_errors(results)), torques[1]],
        "panda_torques": torques[2:],
    }


@styled
def joint_errors_panel(errors: pd.DataFrame) -> Figure:
    """NMSE over the joints; rows of errors are of models and friction, columns of joints."""
    figure, axes = panel("Every joint", 3.5, xlabel="joint", ylabel="NMSE on the test part", yscale="log")
    for key, look in public_names.DYNAMICS_LOOKS.items():
        if key in errors.index:
            its, line = errors.loc[key], "--" if key[0] == "least_squares" else "-"
            axes.plot(its.index, its, line, marker="o", markersize=4, color=look.colour, label=look.name)
    axes.set_xticks(errors.columns)
    return legend(figure)


@styled
def torque_panel(traces: pd.DataFrame, joint: int, title: str, xlabel: str) -> Figure:
    """Torque of one joint, measured and by models, of a table of `arm_identification.trace_table`."""
    figure, axes = panel(title, 3.5, xlabel=xlabel, ylabel="torque (N m)")
    looks = {"_".join(key).removesuffix("_none"): look for key, look in public_names.DYNAMICS_LOOKS.items()}
    its = traces.query("joint == @joint")
    axes.plot(its["time_s"], its["measured"], color=BLACK, linewidth=2.4, alpha=0.35, label="measured")
    for name in TRACED:
        axes.plot(its["time_s"], its[name], color=looks[name].colour, linewidth=1.0, label=looks[name].name)
    low, high = its["measured"].min(), its["measured"].max()
    axes.set_ylim(low - 0.5 * (high - low), high + 0.5 * (high - low))
    return legend(figure)


PART = Part(
    name="panda",
    heading="Inverse dynamics of a Franka Panda",
    page="panda",
    needs=("panda_errors", "panda_friction", "panda_links", "panda_traces"),
    parameters=("recorded_dynamics",),
    metrics=metrics,
    evidence=evidence,
    facts=facts,
    tables=tables,
    pictures=pictures,
)
