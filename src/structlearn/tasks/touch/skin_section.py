"""Page section of a skin touched at known places: its map, forces, and servoing in the map."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.palette import BLACK, BLUE, GREY, LIGHT_GREY, Look
from structlearn.reporting.document import Table
from structlearn.reporting.evidence import Evidence, mean, unknown
from structlearn.reporting.figure_style import Drawing, Raster, legend, map_panels, panel, styled
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import listing
from structlearn.tasks.section import Section
from structlearn.tasks.task_files import TaskFiles
from structlearn.tasks.touch.parameters import DEGREE, PublishedErrors, TouchParameters
from structlearn.tasks.touch.touch_names import (
    ADAPTIVE,
    COMPONENTS,
    FORCE_MODELS,
    NEW_BLOCKS,
    NEW_PRESSES,
    NEW_RUN,
    PLAIN,
    PRESSURE,
    PROCESS,
    PUBLISHED_SERVO,
    QUADRATIC,
    SPACES,
    STRUCTURED,
    shown_map,
)

Tables = Mapping[str, pd.DataFrame]

# endings of the findings' names
ENDINGS = {STRUCTURED: "", PLAIN: "_plain", COMPONENTS: "_components", PROCESS: "_process"}
ERRORS = {
    "map_nmse": "map, NMSE",
    "laid_mm": "map placed on the skin (mm)",
    "latent_mm": "place read (mm)",
    "pressure_nmse": "pressure, NMSE",
    "depth_nmse": "depth, NMSE",
    "signal_nmse": "channels, NMSE",
}
HEADINGS = ERRORS | {
    "new": "what is new",
    "learned_from": "learned from",
    "test_run": "tested on",
    "left_mm": "left (mm)",
    "length_ratio": "path length over the straight path",
    "rms_n": "RMS, mean over presses (N)",
    "worst_n": "largest (N)",
    "signals_s": "channels lag (s)",
    "force_s": "scale lags (s)",
    "readings": "readings of the scale",
}
# values of `quantity` in `skin_within_runs.within_runs`
QUANTITIES = {"place_mm": "place (mm)", "force_n": "normal force (N)", "shear_n": "shear force (N)"}
HEADLINES = ("map_nmse", "latent_mm", "laid_mm", "laid_cross_run_mm", "force_n", "servo_success")
KEYS = ["learned_from", "test_run"]
ARROW = "\N{RIGHTWARDS ARROW}"
MISSING = "no runs for it are recorded here"

BOUND_MM = 0.8  # bound of the claims
PATHS = 16  # servoing paths drawn
STROKES_S = 120.0  # duration of the forces drawn


class SkinRuns:
    """Tables of `learning.learn_touch`; runs are numbered in the order of their names.

    Samples are blocks of places, presses or trials, averaged over seeds. Touches of a block lie close
    together, so blocks are the closest to independent units that a run has.

    Attributes:
        tables: tables by name.
        tuned_on: runs on which constants were tuned.
        numbers: names of runs on the page: runs over places, on a scale, and of shear.
    """

    def __init__(self, tables: Tables, tuned_on: tuple[str, ...]) -> None:
        self.tables, self.tuned_on = tables, tuned_on
        self.numbers = {
            name: f"{word} {number}"
            for table, word in (("errors", "run"), ("force", "scale run"))
            if table in tables
            for number, name in enumerate(sorted(set(tables[table]["learned_from"])), 1)
        }
        if "published" in tables:
            shear = tables["published"].query("quantity == 'shear_n'")["run"]
            self.numbers |= {name: f"shear run {number}" for number, name in enumerate(shear, 1)}

    def __getitem__(self, name: str) -> pd.DataFrame:
        """A table with run numbers instead of names."""
        table = self.tables[name]
        columns = [column for column in ("run", *KEYS) if column in table]
        return table.assign(**{column: table[column].map(self.numbers) for column in columns})

    def pairs(self, name: str) -> list[tuple[tuple[str, str], pd.DataFrame]]:
        """Rows of a table by numbers of the training and the test run."""
        groups = self.tables[name].groupby(KEYS)
        return [((self.numbers[first], self.numbers[second]), rows) for (first, second), rows in groups]

    def values(self, table: str, value: str, sample: str, **chosen: str | tuple[str, ...]) -> pd.Series:
        """Means of the selected rows by training run, test run and sample; empty if the table is missing."""
        if table not in self.tables:
            return pd.Series(dtype=float)
        rows = self.tables[table]
        for column, names in chosen.items():
            rows = rows[rows[column].isin(np.atleast_1d(names))]
        return rows.groupby([*KEYS, sample])[value].mean().dropna()

    def errors(self, new: str, error: str, model: str = STRUCTURED) -> pd.Series:
        """Errors by block of places; of blocks held out, those of runs used for tuning are excluded.

        Depth varies in few runs, so its errors are of all runs.
        """
        values = self.values("errors", error, "block", new=new, model=model)
        if not len(values) or new != NEW_BLOCKS or error == "depth_nmse":
            return values
        return values[~values.index.get_level_values(0).isin(self.tuned_on)]

    def force(self, new: str, model: str = QUADRATIC) -> pd.Series:
        """Rms force error (N) by press."""
        return self.values("force", "rms_n", "press", new=new, model=model)

    def trials(self, value: str, model: str, controllers: tuple[str, ...] = (ADAPTIVE,)) -> pd.Series:
        """Means of a column of `servo` over controllers, by trial."""
        return self.values("servo", value, "trial", model=model, controller=controllers)

    def by_pair(self, values: pd.Series) -> dict[str, pd.Series] | None:
        """Samples by training and test run; None if there are none."""
        groups = values.groupby(level=[0, 1]) if len(values) else ()
        return {f"{self.numbers[a]} {ARROW} {self.numbers[b]}": rows for (a, b), rows in groups} or None


def of_mean(samples: pd.Series) -> Evidence:
    """Mean of independent samples; not tested if there are none."""
    return mean(samples.to_numpy(float)) if len(samples) else unknown(MISSING)


def skin_section(files: TaskFiles) -> Section:
    """Section of a task whose touches are of a skin at known places."""
    parameters = files.entry(TouchParameters)
    runs = SkinRuns(files.tables("touch"), parameters.tuned_on)
    find, origin = find_skin(runs), {"folder": files.folder / "touch", "origins": files.origins()}
    return Section(
        "touch",
        "A magnetic skin" if parameters.by_norm else "The skin",
        "skin.html.jinja",
        "skin_lead.html.jinja",
        facts=skin_facts(runs, find, parameters) | origin,
        find=find,
        tables=skin_tables(runs, parameters.published),
        pictures=skin_pictures(runs),
    )


def find_skin(runs: SkinRuns) -> Findings:
    """Findings, by the names that claims and sentences use."""
    find, rows = Findings("blocks of places, presses or trials"), {}
    for error in ERRORS:
        stem, _, unit = error.rpartition("_")
        for model, ending in ENDINGS.items():
            rows[f"{error}{ending}"] = runs.errors(NEW_BLOCKS, error, model)
            rows[f"{stem}_cross_run_{unit}{ending}"] = runs.errors(NEW_RUN, error, model)
    rows["force_n"] = runs.force(NEW_RUN)
    rows["force_new_presses_n"] = runs.force(NEW_PRESSES)
    rows["force_n_process"] = runs.force(NEW_RUN, PROCESS)
    rows["force_n_pressure"] = runs.force(NEW_RUN, PRESSURE)
    for name, controllers in (("servo_structure", PUBLISHED_SERVO), ("servo_structure_ours", (ADAPTIVE,))):
        ours, rival = (runs.trials("arrived", model, controllers) for model in (STRUCTURED, PLAIN))
        rows[name] = (ours - rival).dropna()
    rows["servo_success"] = runs.trials("arrived", STRUCTURED)
    rows["servo_success_plain"] = runs.trials("arrived", PLAIN)
    for name, samples in rows.items():
        find.mean(name, samples, missing=MISSING, headline=name in HEADLINES and len(samples) > 0)
    # intervals of these cases are those of the rows above: not widened
    gains = {model: rows[f"map_nmse{ENDINGS[model]}"] - rows["map_nmse"] for model in (PLAIN, COMPONENTS)}
    find.add("structure", {model: of_mean(gain.dropna()) for model, gain in gains.items()})
    find.mean("cross_run", runs.by_pair(rows["latent_cross_run_mm"]), missing=MISSING)
    find.add("pressure_and_depth", {name: of_mean(rows[f"{name}_nmse"]) for name in ("pressure", "depth")})
    find.mean("servo", runs.by_pair(rows["servo_success"]), missing=MISSING)
    find.geometric_mean("servo_length_ratio", runs.trials("length_ratio", STRUCTURED), missing=MISSING)
    if "published" in runs.tables:
        for quantity, figures in runs.tables["published"].groupby("quantity", sort=False):
            cases = {
                runs.numbers.get(row.run, row.run): (row.rms, row.readings) for row in figures.itertuples()
            }
            find.among("readings at the end of a run").exact(f"within_run_{quantity}", cases)
        ratios = runs["rivals"].groupby("run")["over_network"] if "rivals" in runs.tables else ()
        find.among("tenths of the end of a run").geometric_mean(
            "over_network",
            {run: ratio.to_numpy() for run, ratio in ratios} or None,
            missing="no run is on a scale",
        )
    return find


def skin_tables(runs: SkinRuns, published: PublishedErrors | None) -> dict[str, Table]:
    """Errors by model, those published, trials of servoing, forces, lags, recordings."""
    tables, keys = {}, ["new", *KEYS, "model"]

    def shown(frame: pd.DataFrame, formats: Mapping[str, str], looks: Mapping[str, Look] = SPACES) -> Table:
        words = {"model": {name: look.name for name, look in looks.items()}}
        return Table(frame.reset_index(), formats, HEADINGS, words=words)

    if "errors" in runs.tables:
        frame = runs["errors"].groupby(keys, sort=False)[[*ERRORS]].mean().dropna(axis=1, how="all")
        formats = {name: ".2f" if name.endswith("_mm") else ".4f" for name in ERRORS}
        tables["skin_errors"] = shown(frame, formats)
    if "servo" in runs.tables:
        by = runs["servo"].groupby([*keys[1:], "controller"], sort=False)
        frame = by.agg({"arrived": "mean", "left_mm": "median", "length_ratio": "median"})
        tables["skin_servo"] = shown(frame, {"arrived": ".0%", "left_mm": ".2f", "length_ratio": ".2f"})
    if "force" in runs.tables:
        by = runs["force"].groupby(keys, sort=False)
        frame = by.agg(presses=("press", "size"), rms_n=("rms_n", "mean"), worst_n=("worst_n", "max"))
        tables["skin_force"] = shown(frame, {"rms_n": ".2f", "worst_n": ".1f"}, FORCE_MODELS)
        tables["skin_lags"] = Table(runs["lags"], {"signals_s": ".2f", "force_s": ".2f"}, HEADINGS)
    if "published" in runs.tables and published is not None:
        across = {"place_mm": runs.errors(NEW_RUN, "latent_mm"), "force_n": runs.force(NEW_RUN)}
        rows = []
        for quantity, figures in runs.tables["published"].groupby("quantity", sort=False):
            row = {"what is read": QUANTITIES[quantity], "published": getattr(published, quantity)}
            each = (f"{rms:.2f} ({seen})" for rms, seen in zip(figures["rms"], figures["seen"], strict=True))
            row["by their protocol"] = ", ".join(each)
            networks = figures["network_rms"].dropna()
            row["their network, by their protocol"] = (
                ", ".join(f"{rms:.2f}" for rms in networks) or "not trained"
            )
            other = across.get(quantity, ())
            rows.append(
                row | {"ours, on another run": f"{other.mean():.2f}" if len(other) else "one run only"}
            )
        tables["skin_published"] = Table(pd.DataFrame(rows), {"published": ".2f"})
    if "recordings" in runs.tables:
        tables["skin_recordings"] = Table(runs.tables["recordings"])
    return tables


def skin_facts(runs: SkinRuns, find: Findings, parameters: TouchParameters) -> dict[str, object]:
    """Findings and other values for the sentences."""
    facts: dict[str, object] = find.numbers() | {
        "runs": listing(f"{number} is {name}" for name, number in runs.numbers.items()),
        "touches": 0,
        "blocks": 0,
        "depth_runs": "no run",
        "shear": [],
        "tuned": listing((runs.numbers.get(name, name) for name in runs.tuned_on), ""),
        "judged": "map_nmse" in find.numbers(),
        "degree": DEGREE,
        "there": set(runs.tables),
        "settings": parameters,
    }
    if "errors" in runs.tables:
        query = "new == @NEW_BLOCKS and model == @STRUCTURED and seed == 0"
        blocks, depth = runs.tables["errors"].query(query), runs.errors(NEW_BLOCKS, "depth_nmse")
        facts["touches"] = int(blocks.groupby("learned_from")["presses"].sum().iloc[0])
        facts["blocks"] = int(blocks["block"].nunique())
        facts["depth_runs"] = listing(sorted({runs.numbers[name] for name, *_ in depth.index}), "no run")
    if "published" in runs.tables:
        shear = runs["published"].query("quantity == 'shear_n'").to_dict("records")
        facts["shear"] = [row | {"printed": row["network_rms"] / row["spread"]} for row in shear]
    if len(force := runs.force(NEW_RUN)):
        lags, (_, run, press) = runs.tables["lags"], force.idxmax()
        facts["lag_signals"] = listing(f"{lag:.2f}" for lag in lags["signals_s"])
        facts["lag_force"] = listing(f"{lag:.2f}" for lag in lags["force_s"])
        facts["worst_press"] = {"n": force.max(), "press": press + 1, "run": runs.numbers[run]}
    return facts


def skin_pictures(runs: SkinRuns) -> dict[str, Drawing | Sequence[Drawing]]:
    """Figures by name, as far as there are data for them."""
    drawn: dict[str, Drawing | Sequence[Drawing]] = {}
    if "errors" in runs.tables:
        drawn = {"skin_map": skin_map(runs), "skin_errors": map_error_panels(runs)}
    if "paths" in runs.tables:
        drawn["skin_paths"] = servo_panels(runs)
    if "traces" in runs.tables:
        drawn["skin_force"] = force_panel(runs)
    return drawn


def skin_map(runs: SkinRuns) -> list[Raster]:
    """Places of touches on the plate, and in the map learned from another run or other blocks."""
    if "maps" not in runs.tables:
        maps = runs.tables["map"]
        extent = 0.1e3 * np.ptp(maps[["x_m", "y_m"]], axis=0).max()
        return map_panels(maps, ("Where touches were", "Positions in the map"), 4.4, extent)
    maps = shown_map(runs.tables["maps"], runs.tuned_on)
    learned, tested = (runs.numbers[maps[column].iloc[0]] for column in KEYS)
    titles = f"The skin: where {tested} pressed it", f"Its map, learned from {learned}"
    return map_panels(maps, titles, 4.6, 2.5)


@styled
def map_error_panels(runs: SkinRuns) -> list[Figure]:
    """Map error and place error of all models, on blocks held out and on other runs."""
    cases = {"blocks held out": NEW_BLOCKS} | ({"other run": NEW_RUN} if "maps" in runs.tables else {})
    figures, apart = [], len(SPACES) + 1
    for error, title, label in (
        ("map_nmse", "Distances on the map", "NMSE"),
        ("latent_mm", "Position of the press", "median error (mm)"),
    ):
        figure, axes = panel(title, ylabel=label, yscale="log" if error == "map_nmse" else "linear")
        for place, (model, look) in enumerate(SPACES.items()):
            for group, new in enumerate(cases.values()):
                evidence = of_mean(runs.errors(new, error, model))
                if np.isfinite(evidence.value):
                    ends = np.nan_to_num([[evidence.value - evidence.low], [evidence.high - evidence.value]])
                    name, at = None if group else look.name, group * apart + place
                    axes.bar(at, evidence.value, 0.8, color=look.colour, label=name)
                    axes.errorbar(at, evidence.value, ends, color=BLACK, capsize=2.0)
        axes.set_xticks([1.5 + group * apart for group in range(len(cases))], list(cases))
        axes.grid(visible=False, axis="x")
        if error == "latent_mm" and "maps" in runs.tables:
            axes.axhline(BOUND_MM, color=BLACK, linewidth=0.8, linestyle="--")
        figures.append(legend(figure))
    return figures


@styled
def servo_panels(runs: SkinRuns) -> list[Figure]:
    """Paths of the probe from press to press, a panel per training run."""
    figures = []
    for (first, second), reached in runs.pairs("paths"):
        title = f"Servoing, {first} {ARROW} {second}"
        figure, axes = panel(title, 4.4, xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
        middle = 0.5e3 * (reached[["x_m", "y_m"]].min() + reached[["x_m", "y_m"]].max()).to_numpy()
        for _, steps in reached[reached["trial"] < PATHS].groupby("trial"):
            path = 1e3 * steps.sort_values("step", kind="stable")[["x_m", "y_m"]].to_numpy() - middle
            target = 1e3 * steps[["target_x_m", "target_y_m"]].to_numpy()[0] - middle
            axes.plot(*np.array([path[0], target]).T, color=LIGHT_GREY, linewidth=0.9)
            axes.plot(*path.T, color=BLUE, linewidth=1.0)
            axes.plot(*path[0], "o", color=GREY, markersize=3.0)
            axes.plot(*target, "x", color=BLACK, markersize=5.0)
        figures.append(figure)
    return figures


@styled
def force_panel(runs: SkinRuns) -> list[Figure]:
    """Force of the scale, and estimated from the skin by a model of another run."""
    figures = []
    for (first, second), trace in runs.pairs("traces"):
        trace = trace[trace["time_s"] - trace["time_s"].iloc[0] < STROKES_S].iloc[::2]
        figure, axes = panel(f"{first.capitalize()} {ARROW} {second}", xlabel="time (s)", ylabel="force (N)")
        axes.plot(trace["time_s"], trace["force_n"], color=GREY, linewidth=2.4, label="scale")
        axes.plot(
            trace["time_s"], trace["read_n"], color=BLUE, linewidth=1.1, label="estimated from the skin"
        )
        figures.append(legend(figure))
    return figures
