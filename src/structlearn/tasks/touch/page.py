"""Page of touches: a skin (`skin_section`), or slides: expected traces, and deviations from them."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.reporting.evidence import Evidence, geometric_mean, in_words, unknown, within
from structlearn.reporting.figure_style import legend, panel, styled
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import listing
from structlearn.tasks.section import Section, shown
from structlearn.tasks.task_files import TaskFiles
from structlearn.tasks.touch.skin_section import skin_section
from structlearn.tasks.touch.touch_names import SLIDE_GROUPS, material_of

Tables = Mapping[str, pd.DataFrame]

TOO_FEW = "it takes two slides over each of two materials"  # to tell materials apart

FEW = 3  # materials named in sentences; tables list all

STREAM_UNITS = {"pose": "m", "joint_positions": "rad", "joint_velocities": "rad/s"}


def sections(files: TaskFiles) -> list[Section]:
    """The section of slides over surfaces, or of a skin."""
    return [slides_section(files) if files.has("surfaces") else skin_section(files)]


STREAM_UNITS |= {"joint_torques": "N m", "wrench": "N, N m", "tactile": "counts"}


def slides_section(files: TaskFiles) -> Section:
    """Section of a task with slides, from the tables of `surface_traces.learn_surfaces`."""
    tables = files.tables("touch")
    find, clock = find_surfaces(tables), tables["clock_errors"]
    rms = tables["deviations"].groupby("group", sort=False)["rms"]
    by_group = rms.agg(trials="size", median_rms="median", largest_rms="max").reset_index()
    first, *others = [slide_panel(tables, place) for place in range(3)]
    return Section(
        "touch",
        "Slides over materials",
        "surfaces.html.jinja",
        "surfaces_lead.html.jinja",
        facts=surface_facts(tables, find) | {"origins": files.origins()},
        find=find,
        tables={
            "slide_channels": shown(by_channels(tables)),
            "slide_clock": shown(clock.assign(unit=clock["kind"].map(STREAM_UNITS))),
            "slides": shown(by_group),
        },
        pictures={"slides": [first, trials_panel(tables)], "slides_more": others},
    )


def find_surfaces(tables: Tables) -> Findings:
    """Findings, by the names that claims and sentences use; predictions are NMSEs by material."""
    find, channels = Findings("slides"), tables["channels"]
    own = dict(list(tables["left_one_out"].dropna(subset="standard").groupby("material")["standard"]))
    across = tables["across_materials"].groupby("expected", sort=False)["standard"]
    either = {name: (evidence, own[name]) for name, evidence in across if name in own}
    find.by(group_ratio, "other_material", either or None, missing=TOO_FEW)
    strong = channels[channels["channels"] == "strong"]
    for name, table in (("predicted", tables["left_one_out"]), ("predicted_strong", strong)):
        cases, alone = dict(list(table.groupby("material")["nmse"])), "no slide could be left out"
        find.geometric_mean(name, cases or None, missing=alone, headline=name == "predicted")
    return find


def group_ratio(first: np.ndarray, second: np.ndarray, comparisons: int = 1) -> Evidence:
    """Ratio of the geometric means of unpaired positive samples (N,) and (M,); Welch's interval of logs."""
    from scipy import stats

    if min(len(first), len(second)) < 2:
        return unknown(TOO_FEW)
    first, second = np.log(first), np.log(second)
    test = stats.ttest_ind(first, second, equal_var=False)
    value = float(np.mean(first) - np.mean(second))
    return within(value, test.confidence_interval, len(first) + len(second), comparisons).mapped(np.exp)


def by_channels(tables: Tables) -> pd.DataFrame:
    """Errors of slides left out, by material and channels: all electrodes, or a group of them."""
    count = tables["statistics"]["electrode"].nunique()
    whole = tables["left_one_out"].assign(channels="all", electrodes=count)
    by = pd.concat([whole, tables["channels"]]).groupby(["material", "channels"], sort=False)
    table = by.agg(
        electrodes=("electrodes", "first"),
        median_rms_counts=("rms", "median"),
        nmse=("nmse", lambda errors: in_words(geometric_mean(errors.to_numpy()), ".2f")),
        better_than_their_mean=("nmse", lambda errors: f"{(errors < 1).sum()} of {len(errors)}"),
    )
    order = list(dict.fromkeys(whole["material"]))
    return table.reset_index().sort_values(
        "material", key=lambda column: column.map(order.index), kind="stable"
    )


def surface_facts(tables: Tables, find: Findings) -> dict[str, object]:
    """Findings and other values for the sentences."""
    deviations, left_out = tables["deviations"], tables["left_one_out"]
    learned = deviations.loc[deviations["group"] == "learned", "demonstration"]
    other = find["other_material"]
    channels = by_channels(tables).set_index(["material", "channels"])["nmse"]
    by_material = () if isinstance(other, Evidence) else other.items()
    better = [
        f"{(errors < 1).sum()} of {len(errors)} over {name}"
        for name, errors in list(left_out.groupby("material", sort=False)["nmse"])[:FEW]
    ]
    return find.numbers() | {
        "materials": list(dict.fromkeys(map(material_of, deviations["demonstration"]))),
        "slides": len(deviations),
        "learned": len(learned),
        "material": material_of(learned.iloc[0]),
        "predicted": listing(better, ""),
        "worst": deviations.loc[deviations["rms"].idxmax()].to_dict(),
        "more": {name: in_words(evidence, ".2f") for name, evidence in list(by_material)[:FEW]},
        "nmse_of": {name: channels[name].to_dict() for name in channels.index.unique(0)[:FEW]},
    }


@styled
def slide_panel(tables: Tables, place: int) -> Figure:
    """Deviation of one of the electrodes that vary most: mean and std over the trials of a group."""
    groups = {name: rows for name, rows in tables["statistics"].groupby("group")}
    electrode = groups["learned"].groupby("electrode")["std"].mean().nlargest(3).index[place]
    title = f"Electrode {electrode}: mean and std over trials"
    figure, axes = panel(title, xlabel="time (s)", ylabel="deviation (counts)")
    for group in (name for name in ("other material", "learned") if name in groups):
        look, rows = SLIDE_GROUPS[group], groups[group].query("electrode == @electrode").iloc[::4]
        low, high = rows["mean"] - rows["std"], rows["mean"] + rows["std"]
        axes.fill_between(rows["time_s"], low, high, color=look.colour, alpha=0.2, linewidth=0)
        axes.plot(rows["time_s"], rows["mean"], color=look.colour, label=look.name)
    return legend(figure)


@styled
def trials_panel(tables: Tables) -> Figure:
    """Deviation of every trial; of one learned from, from the traces expected by the others."""
    figure, axes = panel("Every trial", ylabel="root mean square (counts)")
    alone = tables["left_one_out"].set_index("demonstration")["rms"]
    trials = tables["deviations"]
    rms = trials["rms"].where(trials["group"] != "learned", trials["demonstration"].map(alone))
    for group, look in SLIDE_GROUPS.items():
        chosen = np.flatnonzero(trials["group"] == group)
        axes.bar(chosen, rms.iloc[chosen], color=look.colour, label=look.name)
    axes.set_xticks(range(len(trials)), trials["demonstration"], rotation=90, fontsize=7)
    axes.grid(axis="x", visible=False)
    return legend(figure, 3)
