"""The part of the recorded page on inverse dynamics: models of a real arm on motion new to them."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure as Picture

from structlearn.ground.artefacts import Metrics
from structlearn.palette import BLACK, BLUE, GREEN, GREY, ORANGE, SKY, VERMILION
from structlearn.reporting.figures import canvas, legend_above, styled
from structlearn.reporting.page import Prose, Section, Sizes, Table, beside
from structlearn.reporting.prose import listing, rounded
from structlearn.rigid_body.model_names import NAMES as MODEL_NAMES
from structlearn.rigid_body.model_names import STRICT
from structlearn.testbeds.recorded.protocol.panda_identification import (
    LEAST_SQUARES,
    URDF,
    RecordedDynamicsResults,
)

NAMES = {URDF: "URDF as it is"} | MODEL_NAMES | {LEAST_SQUARES: "least squares"}

FRICTION_NAMES = {
    "none": "",
    "viscous": "viscous",
    "coulomb": "viscous, Coulomb",
    "offset": "viscous, Coulomb, offset",
}

TEST = "test"

CENTRE = ("centre_x_m", "centre_y_m", "centre_z_m")

CONSISTENT = ("tri", "cov")
"""Structures of bodies that can exist."""

AIMED_RATIO = 2.0
"""Largest error over that of least squares with the same friction, on every joint."""

AIMED_MEAN, AIMED_LAST = 0.02, 0.06
"""Largest NMSE: mean over all joints but the last, and of the last."""

CURVES = {
    (URDF, "none"): ("URDF as it is", GREY, "-"),
    ("mlp", "none"): ("MLP", VERMILION, "-"),
    ("mlp_scaled", "none"): ("MLP, scaled", ORANGE, "-"),
    (LEAST_SQUARES, "coulomb"): ("least squares, Coulomb", BLACK, "--"),
    ("cov", "viscous"): ("Cov, viscous", SKY, "-"),
    ("cov", "coulomb"): ("Cov, Coulomb", BLUE, "-"),
    ("cov", "offset"): ("Cov, Coulomb, offset", GREEN, ":"),
}
"""Label, colour and line of models in figures."""

TRACED = ("urdf", "mlp", "cov_viscous", "cov_coulomb")
"""Columns of the traces that are drawn beside the measured torque."""

TRACED_JOINTS = (1, 5, 6, 7)


def errors(results: RecordedDynamicsResults, part: str = TEST) -> pd.DataFrame:
    """NMSE by model and friction (index, in their order) and joint (columns, from 1), mean over seeds."""
    rows = results.errors[results.errors["part"] == part]
    wide = rows.pivot_table(
        index=["model", "friction"], columns="joint", values="nmse", aggfunc="mean", sort=False
    )
    models, frictions = list(NAMES), list(FRICTION_NAMES)
    keys = [(models.index(model), frictions.index(friction)) for model, friction in wide.index]
    order = sorted(range(len(keys)), key=lambda place: (keys[place][1] != 0, keys[place][1], keys[place][0]))
    return wide.iloc[order]


def error_table(results: RecordedDynamicsResults) -> pd.DataFrame:
    """`model`, `friction`; NMSE `joint_1` ..., `mean`."""
    wide = errors(results)
    names = pd.DataFrame(
        {
            "model": [NAMES[model] for model, _ in wide.index],
            "friction": [FRICTION_NAMES[friction] for _, friction in wide.index],
        }
    )
    numbers = wide.rename(columns=lambda joint: f"joint_{joint}").reset_index(drop=True)
    return pd.concat([names, numbers.assign(mean=wide.mean(axis=1).to_numpy())], axis=1)


def friction_table(results: RecordedDynamicsResults, model: str = "cov") -> pd.DataFrame:
    """`joint`, `viscous`, `coulomb` in N m s/rad and N m of a model with both."""
    its = results.friction[(results.friction["model"] == model) & (results.friction["friction"] == "coulomb")]
    wide = its.pivot_table(index="joint", columns="term", values="value")
    return wide.reset_index()[["joint", "viscous", "coulomb"]]


def body_table(results: RecordedDynamicsResults, model: str = "cov") -> pd.DataFrame:
    """`link`, `mass_kg`, `true_mass_kg` (of the URDF) and the centre of mass of a model's links."""
    links = results.links
    its = links[(links["model"] == model) & (links["friction"] == "coulomb")]
    return its[["link", "mass_kg", "true_mass_kg", *CENTRE]]


def tables(
    results: RecordedDynamicsResults, slide_torques: pd.DataFrame, slide_payloads: pd.DataFrame
) -> dict[str, pd.DataFrame]:
    """Tables by name."""
    return {
        "panda": error_table(results),
        "panda_friction": results.friction,
        "panda_links": results.links,
        "slide_torques": slide_torques,
        "slide_payloads": slide_payloads,
    }


def metrics(results: RecordedDynamicsResults) -> Metrics:
    """Means over joints of the NMSE on the test part."""
    means = errors(results).mean(axis=1)
    return {
        "panda_nmse_default": means[URDF, "none"],
        "panda_nmse_least_squares_viscous": means[LEAST_SQUARES, "viscous"],
        "panda_nmse_least_squares_coulomb": means[LEAST_SQUARES, "coulomb"],
        "panda_nmse_cov_viscous": means["cov", "viscous"],
        "panda_nmse_cov_coulomb": means["cov", "coulomb"],
        "panda_nmse_mlp": means["mlp", "none"],
    }


def pictures(results: RecordedDynamicsResults) -> dict[str, Picture]:
    """Figures by name."""
    return {"panda": errors_figure(results), "panda_torques": torques_figure(results)}


@styled
def errors_figure(results: RecordedDynamicsResults) -> Picture:
    """NMSE on the test part over the joints."""
    wide = errors(results)
    figure = canvas(3.2)
    panel = figure.subplots()
    for key, (label, colour, line) in CURVES.items():
        if key in wide.index:
            its = wide.loc[key]
            panel.plot(its.index, its, marker="o", markersize=4, color=colour, linestyle=line, label=label)
    panel.set(xlabel="joint", ylabel="NMSE, test", yscale="log")
    panel.set_xticks(wide.columns)
    legend_above(figure, panel, columns=4)
    return figure


@styled
def torques_figure(results: RecordedDynamicsResults) -> Picture:
    """Torques of the test part, measured and by models."""
    colours = {
        f"{model}_{friction}".removesuffix("_none"): look for (model, friction), look in CURVES.items()
    }
    traces = results.traces
    figure = canvas(4.2)
    panels = figure.subplots(2, 2, sharex=True).ravel()
    for panel, joint in zip(panels, TRACED_JOINTS, strict=True):
        its = traces[traces["joint"] == joint]
        panel.plot(its["time_s"], its["measured"], color=BLACK, linewidth=2.4, alpha=0.35, label="measured")
        for name in TRACED:
            label, colour, line = colours[name]
            panel.plot(its["time_s"], its[name], color=colour, linestyle=line, linewidth=1.0, label=label)
        panel.set_title(f"Joint {joint} (N m)")
        low, high = its["measured"].min(), its["measured"].max()
        room = 0.5 * (high - low)
        panel.set_ylim(low - room, high + room)
    for panel in panels[2:]:
        panel.set_xlabel("time of the test part (s)")
    legend_above(figure, panels[0])
    return figure


def section(
    results: RecordedDynamicsResults,
    slide_torques: pd.DataFrame,
    slide_payloads: pd.DataFrame,
    sizes: Sizes,
) -> Section:
    """The section of the page."""
    table = error_table(results)
    numbers = [name for name in table if name.startswith("joint_")]
    plain = frozenset(np.flatnonzero(table["model"] == NAMES[LEAST_SQUARES]).tolist())
    return Section(
        "Inverse dynamics of a Franka Panda",
        (
            Prose(_what_was_done()),
            Table(
                table,
                "NMSE of joint torques on the test part; networks: mean over seeds. Bold: least squares, "
                "which may find bodies that cannot exist.",
                formats=dict.fromkeys([*numbers, "mean"], ".2g"),
                headings={name: name.replace("_", " ") for name in numbers},
                strong=plain,
                source="tables/panda.csv",
            ),
            Prose(_how_good(results)),
            beside(
                "panda",
                sizes,
                "NMSE on the test part by joint.",
                "Seven curves over seven joints on a logarithmic axis.",
            ),
            Prose(_friction(results)),
            beside(
                "panda_torques",
                sizes,
                "Torques of the test part. Where a joint turns round, friction changes its sign.",
                "Measured torques of four joints over time with those of four models.",
            ),
            Table(
                friction_table(results),
                "Learned friction of Cov with viscous and Coulomb friction.",
                formats=dict.fromkeys(("viscous", "coulomb"), ".2f"),
                headings={"viscous": "viscous (N m s/rad)", "coulomb": "Coulomb (N m)"},
                source="tables/panda_friction.csv",
                folded=True,
            ),
            Table(
                body_table(results),
                "Learned links of Cov with viscous and Coulomb friction. Masses of the URDF are made up, and "
                "not every mass shows in the torques.",
                formats=dict.fromkeys(("mass_kg", "true_mass_kg"), ".2f") | dict.fromkeys(CENTRE, ".3f"),
                headings={"mass_kg": "mass (kg)", "true_mass_kg": "in the URDF"}
                | {name: f"centre {name[7]} (m)" for name in CENTRE},
                source="tables/panda_links.csv",
                folded=True,
            ),
            Prose(_networks(results)),
            Prose(_slides(slide_torques, slide_payloads)),
            Table(
                slide_torques,
                "Torques of the slides beside the URDF's, with their sign as recorded (1) and turned (-1), "
                "without and with a payload; N m, the last column root mean square.",
                formats=dict.fromkeys(("measured_n_m", "model_n_m", "left_n_m"), ".2f"),
                headings={"measured_n_m": "measured, mean", "model_n_m": "model, mean", "left_n_m": "left"},
                source="tables/slide_torques.csv",
                folded=True,
            ),
            Table(
                slide_payloads,
                "The payload that fits best; its centre in the last joint's frame.",
                formats={"mass_kg": ".2f"} | dict.fromkeys(CENTRE, ".3f"),
                headings={"mass_kg": "mass (kg)"} | {name: f"centre {name[7]} (m)" for name in CENTRE},
                source="tables/slide_payloads.csv",
                folded=True,
            ),
        ),
    )


def _what_was_done() -> str:
    return (
        "A real Franka Emika Panda on an exciting trajectory of 21 s, published with its identification by "
        "Gaz et al. (2019). All signals are low-passed without delay; models learn from the first part and "
        "are tested on the rest. Structures start at PyBullet's URDF, whose inertias are made up, and are "
        "fitted to the sum of the joints' NMSEs, like least squares. Structures and DeLaN learn joint "
        "friction too: viscous as in the dissertation, and Coulomb friction, which it names as future work."
    )


def _how_good(results: RecordedDynamicsResults) -> str:
    wide = errors(results)
    found = []
    for friction in ("viscous", "coulomb", "offset"):
        if (LEAST_SQUARES, friction) in wide.index:
            ratios = [
                (wide.loc[(model, friction)] / wide.loc[(LEAST_SQUARES, friction)]).max()
                for model in CONSISTENT
            ]
            found.append(f"{max(ratios):.2f} ({FRICTION_NAMES[friction]})")
    within = []
    for model in CONSISTENT:
        its = wide.loc[(model, "coulomb")]
        within.append((NAMES[model], its.iloc[:-1].mean(), its.iloc[-1]))
    met = all(mean <= AIMED_MEAN and last <= AIMED_LAST for _, mean, last in within)
    each = listing(f"{name} {mean:.4f} and {last:.3f}" for name, mean, last in within)
    return (
        "Bodies that can exist explain the torques about as well as any numbers can: the error of Tri and "
        f"Cov is at most so many times that of least squares, on any joint: {', '.join(found)}; the aim was "
        f"{AIMED_RATIO:g}. With Coulomb friction, mean NMSE without the last joint and NMSE of the last are "
        f"{each}; the aim of {AIMED_MEAN:g} and {AIMED_LAST:g} is {'met' if met else 'missed'}."
    )


def _friction(results: RecordedDynamicsResults) -> str:
    wide = errors(results)
    gains = {
        model: wide.loc[(model, "viscous")].mean() / wide.loc[(model, "coulomb")].mean() for model in STRICT
    }
    by_joint = wide.loc[("cov", "viscous")] / wide.loc[("cov", "coulomb")]
    return (
        "Coulomb friction lowers the mean NMSE of "
        f"{listing(f'{NAMES[model]} by a factor of {gain:.1f}' for model, gain in gains.items())}; by joint, "
        f"of Cov, from {by_joint.min():.1f} (joint {by_joint.idxmin()}) to {by_joint.max():.1f} (joint "
        f"{by_joint.idxmax()}). So static friction was what the dissertation's models lacked, on this arm "
        "at least."
    )


def _networks(results: RecordedDynamicsResults) -> str:
    test, train = (errors(results, part).mean(axis=1) for part in (TEST, "train"))
    cov = test["cov", "coulomb"]
    parts = []
    for key in (("mlp", "none"), ("mlp_scaled", "none"), ("delan", "viscous"), ("delan", "coulomb")):
        if key in test.index:
            name = f"{NAMES[key[0]]}{' + Coulomb' if key[1] == 'coulomb' else ''}"
            parts.append(f"{name} {train[key]:.2g} → {test[key]:.2g}")
    return (
        f"Networks on the same samples, mean NMSE of the train and of the test part: {', '.join(parts)}; Cov "
        f"with Coulomb friction {train['cov', 'coulomb']:.2g} → {cov:.2g}. The test part goes where the "
        "first part has not been, and nothing tells a network what is there."
    )


def _slides(torques: pd.DataFrame, payloads: pd.DataFrame) -> str:
    fitted = torques[torques["payload"]].groupby("sign")["left_n_m"].max()
    masses = payloads.set_index("sign")["mass_kg"]
    return (
        "The recorded slides above have joint torques too, of a KUKA iiwa with a sensor in its hand. They "
        "are too slow to learn inertias from, and their sign is the other way round: with a payload fitted, "
        f"what the URDF leaves of a joint's torque is at most {fitted[-1]:.1f} N m (root mean square) with "
        f"the sign turned, and the payload weighs {masses[-1]:.1f} kg; as recorded {fitted[1]:.1f} N m are "
        f"left, and the payload would weigh {rounded(masses[1], '.1f')} kg."
    )
