"""A skin that was touched at known places: is its map the skin, how hard was it pressed, servoing in it."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.reporting.claims import Evidence, Found, by_case, mean, unknown
from structlearn.reporting.document import Table
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import listing
from structlearn.tasks.section import Section
from structlearn.tasks.touch.touch_names import (
    COMPONENTS,
    CORRECTED,
    FORCE_MODELS,
    NEW_BLOCKS,
    NEW_PRESSES,
    NEW_RUN,
    PLAIN,
    PRESSURE,
    PROCESS,
    QUADRATIC,
    SPACES,
    STRUCTURED,
    TEXT_SERVO,
)
from structlearn.tasks.touch.touch_parameters import TouchParameters

ENDINGS = {STRUCTURED: "", PLAIN: "_plain", COMPONENTS: "_components", PROCESS: "_process"}
"""Of the findings' names."""

ERRORS = {
    "map_nmse": "map, NMSE",
    "laid_mm": "map laid down (mm)",
    "latent_mm": "place read (mm)",
    "pressure_nmse": "pressure, NMSE",
    "depth_nmse": "depth, NMSE",
    "signal_nmse": "channels, NMSE",
}
HEADINGS = ERRORS | {
    "new": "what is new",
    "learned_from": "learned from",
    "asked_about": "tested on",
    "left_mm": "left (mm)",
    "length_ratio": "way, over the straight one",
    "rms_n": "RMS, mean over presses (N)",
    "worst_n": "largest (N)",
    "signals_s": "channels lag (s)",
    "force_s": "scale lags (s)",
    "readings": "readings of the scale",
}
HEADLINES = ("map_nmse", "latent_mm", "laid_mm", "laid_cross_run_mm", "force_n", "servo_success")
ARROW = "\N{RIGHTWARDS ARROW}"
MISSING = unknown("no runs for it are recorded here")


@dataclass(frozen=True)
class SkinRuns:
    """The tables of `skin_touches.learn_touch`; runs are called `run 1`, `run 2` in the order of their names.

    Blocks of places are what is independent in a run, as far as anything is: touches of a block lie together.
    Seeds are averaged before.
    """

    tables: Mapping[str, pd.DataFrame]
    tuned_on: tuple[str, ...]

    @cached_property
    def numbers(self) -> dict[str, str]:
        """What runs are called, those over places and those on a scale apart."""
        return {
            name: f"{word} {number}"
            for table, word in (("errors", "run"), ("force", "scale run"))
            if table in self.tables
            for number, name in enumerate(sorted(set(self.tables[table]["learned_from"])), 1)
        }

    def __getitem__(self, name: str) -> pd.DataFrame:
        """A table with the runs' numbers."""
        table = self.tables[name]
        columns = [column for column in ("run", "learned_from", "asked_about") if column in table]
        return table.assign(**{column: table[column].map(self.numbers) for column in columns})

    def _values(self, table: str, value: str, keys: list[str], **chosen: tuple[str, ...]) -> pd.Series:
        """Mean values by keys of some rows; none where there are none."""
        if table not in self.tables:
            return pd.Series(dtype=float)
        its = self.tables[table]
        for column, names in chosen.items():
            its = its[its[column].isin(names)]
        return its.groupby(keys)[value].mean().dropna()

    def errors(self, new: str, error: str, model: str = STRUCTURED) -> pd.Series:
        """By `learned_from`, `asked_about` and `block`."""
        keys = ["learned_from", "asked_about", "block"]
        return self._values("errors", error, keys, new=(new,), model=(model,))

    def held_out(self, error: str, model: str = STRUCTURED) -> pd.Series:
        """On blocks held out of runs on which nothing was tuned; depth, which varies in few, of all runs."""
        found = self.errors(NEW_BLOCKS, error, model)
        if not len(found) or error == "depth_nmse":
            return found
        return found[~found.index.get_level_values(0).isin(self.tuned_on)]

    def force(self, new: str, model: str = QUADRATIC) -> pd.Series:
        """N, root mean square of each press."""
        keys = ["learned_from", "asked_about", "press"]
        return self._values("force", "rms_n", keys, new=(new,), model=(model,))

    def trials(self, value: str, model: str, *controllers: str) -> pd.Series:
        """By `learned_from`, `asked_about` and `trial`, mean over seeds and controllers."""
        keys = ["learned_from", "asked_about", "trial"]
        return self._values("servo", value, keys, model=(model,), controller=controllers)

    def by_pair(self, found: pd.Series) -> Found:
        """Means by training and test run."""
        if not len(found):
            return MISSING
        groups = found.groupby(level=[0, 1])
        cases = {f"{self.numbers[a]} {ARROW} {self.numbers[b]}": [its.to_numpy()] for (a, b), its in groups}
        return by_case(mean, cases)


def of_mean(samples: pd.Series) -> Evidence:
    """Mean of independent samples, `MISSING` of none."""
    return mean(samples.to_numpy(float)) if len(samples) else MISSING


def section(tables: Mapping[str, pd.DataFrame], parameters: TouchParameters, folder: Path) -> Section:
    """Of a skin whose tables and networks are in a folder."""
    from structlearn.tasks.touch.skin_figures import skin_pictures

    runs = SkinRuns(tables, parameters.tuned_on)
    find = find_skin(runs)
    return Section(
        "touch",
        "A magnetic skin" if parameters.by_norm else "The skin",
        "skin.html.jinja",
        "skin_lead.html.jinja",
        facts=skin_facts(runs, find, parameters) | {"folder": folder},
        find=find,
        tables=skin_tables(runs),
        pictures=skin_pictures(runs),
    )


def find_skin(runs: SkinRuns) -> Findings:
    """What was found, by the names that claims and sentences use."""
    find = Findings("blocks of places, presses or trials")

    def add(name: str, samples: pd.Series) -> None:
        find.add(name, of_mean(samples), headline=name in HEADLINES and len(samples) > 0)

    for error in ERRORS:
        stem, _, unit = error.rpartition("_")
        for model, ending in ENDINGS.items():
            across = f"{stem}_cross_run_{unit}{ending}"
            add(f"{error}{ending}", runs.held_out(error, model))
            add(across, runs.errors(NEW_RUN, error, model))
    gain = {
        model: of_mean((runs.held_out("map_nmse", model) - runs.held_out("map_nmse")).dropna())
        for model in (PLAIN, COMPONENTS)
    }
    find.add("structure", gain)
    find.add("cross_run", runs.by_pair(runs.errors(NEW_RUN, "latent_mm")))
    both = {name: of_mean(runs.held_out(f"{name}_nmse")) for name in ("pressure", "depth")}
    find.add("pressure_and_depth", both)
    for name, new, model in (
        ("force_n", NEW_RUN, QUADRATIC),
        ("force_new_presses_n", NEW_PRESSES, QUADRATIC),
        ("force_n_process", NEW_RUN, PROCESS),
        ("force_n_pressure", NEW_RUN, PRESSURE),
    ):
        add(name, runs.force(new, model))
    for name, controllers in (("servo_structure", TEXT_SERVO), ("servo_structure_ours", (CORRECTED,))):
        share = [runs.trials("arrived", model, *controllers) for model in (STRUCTURED, PLAIN)]
        add(name, (share[0] - share[1]).dropna())
    for model, ending in ((STRUCTURED, ""), (PLAIN, "_plain")):
        add(f"servo_success{ending}", runs.trials("arrived", model, CORRECTED))
    find.add("servo", runs.by_pair(runs.trials("arrived", STRUCTURED, CORRECTED)))
    ways = of_mean(np.log(runs.trials("length_ratio", STRUCTURED, CORRECTED)))
    value, low, high = np.exp([ways.value, ways.low, ways.high]).tolist()
    find.add("servo_length_ratio", Evidence(value, low, high, ways.n, reason=ways.reason))
    return find


def skin_tables(runs: SkinRuns) -> dict[str, Table]:
    """By name: errors by model, trials of servoing, forces, lags, recordings."""
    shown = {}
    keys = ["new", "learned_from", "asked_about", "model"]
    if "errors" in runs.tables:
        frame = runs["errors"].groupby(keys, sort=False)[[*ERRORS]].mean().dropna(axis=1, how="all")
        formats = {name: ".2f" if name.endswith("_mm") else ".4f" for name in ERRORS}
        words = {"model": {name: look.name for name, look in SPACES.items()}}
        shown["skin_errors"] = Table(frame.reset_index(), formats, HEADINGS, words=words)
    if "servo" in runs.tables:
        by = runs["servo"].groupby([*keys[1:], "controller"], sort=False)
        frame = by.agg(
            arrived=("arrived", "mean"),
            left_mm=("left_mm", "median"),
            length_ratio=("length_ratio", "median"),
        )
        formats = {"arrived": ".0%", "left_mm": ".2f", "length_ratio": ".2f"}
        shown["skin_servo"] = Table(frame.reset_index(), formats, HEADINGS, words=words)
    if "force" in runs.tables:
        by = runs["force"].groupby(keys, sort=False)
        frame = by.agg(presses=("press", "size"), rms_n=("rms_n", "mean"), worst_n=("worst_n", "max"))
        words = {"model": {name: look.name for name, look in FORCE_MODELS.items()}}
        formats = {"rms_n": ".2f", "worst_n": ".1f"}
        shown["skin_force"] = Table(frame.reset_index(), formats, HEADINGS, words=words)
        shown["skin_lags"] = Table(runs["lags"], {"signals_s": ".2f", "force_s": ".2f"}, HEADINGS)
    if "recordings" in runs.tables:
        shown["skin_recordings"] = Table(runs.tables["recordings"])
    return shown


def skin_facts(runs: SkinRuns, find: Findings, parameters: TouchParameters) -> dict[str, object]:
    """All findings, and other values for the sentences."""
    blocks = runs.tables.get("errors", pd.DataFrame({"new": [], "model": [], "seed": [], "learned_from": []}))
    blocks = blocks[(blocks["new"] == NEW_BLOCKS) & (blocks["model"] == STRUCTURED) & (blocks["seed"] == 0)]
    presses = blocks.groupby("learned_from")["presses"].sum() if len(blocks) else pd.Series([0])
    lags = runs.tables.get("lags", pd.DataFrame({"signals_s": [], "force_s": []}))
    depth = runs.errors(NEW_BLOCKS, "depth_nmse")
    force = runs.force(NEW_RUN)
    worst = force.idxmax() if len(force) else None
    return find.numbers() | {
        "runs": listing(f"{number} is {name}" for name, number in runs.numbers.items()),
        "run_count": len(presses),
        "touches": int(presses.iloc[0]),
        "blocks": int(blocks["block"].nunique()) if len(blocks) else 0,
        "tuned": listing((runs.numbers.get(name, name) for name in runs.tuned_on), ""),
        "depth_runs": listing(sorted({runs.numbers[name] for name, *_ in depth.index}), "no run"),
        "judged": "map_nmse" in find.numbers(),
        "crossed": "maps" in runs.tables,
        "served": "paths" in runs.tables,
        "weighed": "traces" in runs.tables,
        "lag_signals": listing(f"{lag:.2f}" for lag in lags["signals_s"]),
        "lag_force": listing(f"{lag:.2f}" for lag in lags["force_s"]),
        "worst_press": {"n": force[worst], "press": worst[2] + 1, "run": runs.numbers[worst[1]]}
        if worst
        else {},
        "settings": parameters,
    }
