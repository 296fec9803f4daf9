"""Ablations of the refinement: one parameter changed at a time, every run an experiment of DVC.

    python benchmarks/ablations.py [--seeds N]

Each experiment runs in a directory of its own (`dvc exp run --temp`), so the workspace stays as it is; it is
kept by name for `dvc exp show`, `dvc exp diff` and `dvc exp apply`. What has been run before comes out of the
run cache. Writes the report `reports/ablations`.
"""

import argparse
import subprocess

import dvc.api
import pandas as pd
from tqdm import tqdm

from structlearn.ground.params import read_parameters
from structlearn.reporting.publishing import publish_report
from structlearn.testbeds.scraping.page.ablation_page import (
    Experiment,
    Variant,
    ablation_page,
    metrics,
    outcomes,
)
from structlearn.testbeds.scraping.protocol.board_refinement import BoardRefinementParameters

VARIANTS = (
    Variant("default", "as in params.yaml"),
    Variant("samples_10", "K = 10 samples", "refine.search.samples=10"),
    Variant("samples_20", "K = 20 samples", "refine.search.samples=20"),
    Variant("covariance_kept", "covariance kept", "refine.search.covariance.mode=kept"),
    Variant("covariance_full", "full covariance", "refine.search.covariance.mode=full"),
    Variant("added_1", "one added rollout", "refine.added_runs=1"),
    Variant("added_8", "eight added rollouts", "refine.added_runs=8"),
)
DATA = "data/feedback/scraping"


def main() -> None:
    """Run what is missing, and report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=1, help="seeds of the exploration per variant")
    seeds = range(parser.parse_args().seeds)
    parameters = read_parameters("params.yaml", "refine", BoardRefinementParameters)
    work = [(variant, seed) for variant in VARIANTS for seed in seeds]
    experiments = [experiment(variant, seed) for variant, seed in tqdm(work, desc="experiments")]
    table = outcomes(experiments, parameters)
    page, shown = ablation_page(table, parameters, VARIANTS)
    values = metrics(table)
    headlines = [name for name in values if "default" in name or "added" in name]
    publish_report("reports/ablations", {"index": page}, {}, shown, values, headlines)
    print("reports/ablations/index.html is up to date")


def experiment(variant: Variant, seed: int) -> Experiment:
    """Run refinement and evaluation with one change, and read what came of it."""
    name = f"refine-{variant.name}-seed-{seed}"
    changes = [f"refine.seed={seed}", *([variant.option] if variant.option else [])]
    options = [word for change in changes for word in ("--set-param", change)]
    subprocess.run(["dvc", "exp", "remove", name], capture_output=True, check=False)  # of an earlier run
    command = ["dvc", "exp", "run", "--temp", "--name", name, *options, "evaluate_refinement"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}\n{done.stdout}{done.stderr}")
    return Experiment(variant.name, seed, table(name, "refinement/history"), table(name, "refined/scores"))


def table(experiment_name: str, path: str) -> pd.DataFrame:
    """A table that an experiment wrote, from the cache."""
    with dvc.api.open(f"{DATA}/{path}.parquet", repo=".", rev=experiment_name, mode="rb") as file:
        return pd.read_parquet(file)


if __name__ == "__main__":
    main()
