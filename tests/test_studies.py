"""Studies: cells run the stages of a testbed with other seeds; tables say with which parameters and code."""

import json
import os
import runpy
import shutil
import socket
import subprocess
import sys
from contextlib import ExitStack, chdir
from pathlib import Path

import dask
import numpy as np
import pandas as pd
import pytest
import yaml
from committed import ROOT, read_yaml
from distributed import Client
from import_graph import packages

from dissertation.evidence import study_cells, study_tables
from dissertation.evidence.studies import (
    RESULTS,
    Check,
    Origin,
    Study,
    StudyProvenance,
    provenance,
    read_study,
    rests_on,
    stored_study,
)
from dissertation.evidence.study_cells import (
    CELLS,
    Description,
    changed,
    make_cell,
    read_descriptions,
    run_cell,
    run_cells,
    seeds_of,
    write_cell,
)
from dissertation.evidence.study_tables import check_study, compare, join_study, joined, made_with
from structlearn.core import code_digests, parallel
from structlearn.core.artefacts import write_table
from structlearn.core.errors import InputError
from structlearn.reporting.document import UNKNOWN_COMMIT, source_commit

NAME = "toy/people"
DESCRIPTION = Description(
    question="Does more help?",
    seeds=["learn.seed", "people.test"],
    stages=["learn", "results"],
    variants={"published": {"parameters": {"results.factor": 10}, "first": "results"}},
)
LEARN = """
import yaml
from pathlib import Path
learn = yaml.safe_load(open('params.yaml'))['learn']
count = Path('data/count.txt')
count.parent.mkdir(exist_ok=True)
count.write_text(str(int(count.read_text() if count.exists() else 0) + 1))
if learn['seed'] == 66:
    raise SystemExit('no such person')
Path('data/learnt.txt').write_text(str(learn['seed'] * learn['steps']))
"""
KILL = """    killed = Path('{folder}/killed')
    if not killed.exists():
        killed.touch()
        import os
        os.kill(os.getppid(), 9)
"""
REDUCE = """
import pandas as pd
import yaml
from pathlib import Path
from structlearn.core.artefacts import write_table
values = yaml.safe_load(open('params.yaml'))
cost = int(Path('data/learnt.txt').read_text()) * values['results']['factor']
runs, people = int(Path('data/count.txt').read_text()), values['people']['test']
rows = [('cost', cost, person, 0.0) for person in people]
rows += [('runs', runs, person, float('nan')) for person in people]  # applies to no setting
table = pd.DataFrame(rows, columns=['quantity', 'value', 'person', 'setting'])
table = table.assign(stage='toy_learn', unit='')
write_table(table.astype({'value': float}), 'data/results/toy.parquet')
"""


MORE_STEPS = ("learn['steps'])", "learn['steps'] + 1)")  # a mutant in a method


@pytest.fixture
def scripts(tmp_path):
    """A project of two stages."""
    for name, text in (("learn", LEARN), ("results", REDUCE)):
        path = tmp_path / f"stages/toy/{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    stages = {"toy_learn": {"params": ["learn.steps", "learn.seed"]}, "toy_results": {"params": ["results"]}}
    (tmp_path / "dvc.yaml").write_text(yaml.safe_dump({"stages": stages}))
    cells = tmp_path / "stages/studies/dvc.yaml"
    cells.parent.mkdir()
    cells.write_text(yaml.safe_dump({"stages": {"toy_people": {"foreach": [9, 10], "do": {}}}}))
    values = {"learn": {"steps": 4, "seed": 1}, "results": {"factor": 1}, "people": {"test": [1, 2]}}
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(values))
    return tmp_path


@pytest.fixture
def toy(scripts, monkeypatch):
    """The same, with stages that run in this process, which starts none."""

    def run_stage(script, folder, root, cell):
        with chdir(folder):
            runpy.run_path(script)

    monkeypatch.setattr(study_cells, "run_stage", run_stage)
    return scripts


def run(toy, *cells):
    """Run cells, and join them with the tables in git."""
    for cell in cells:
        write_cell(*make_cell(NAME, DESCRIPTION, cell, toy), toy / CELLS / NAME / cell)
    join_study(NAME, DESCRIPTION, toy)
    return stored_study(toy / RESULTS / NAME)


@pytest.mark.parametrize(
    ("cell", "fault"), [("x", "not a seed"), ("3-1", "1 is below 3"), ("-2", "not a seed")]
)
def test_a_cell_is_named_by_its_seeds(cell, fault):
    assert [seeds_of("13"), seeds_of("19-21")] == [[13], [19, 20, 21]]
    with pytest.raises(InputError, match=f"cell {cell}: .*{fault}"):
        seeds_of(cell)


def each(results, quantity, variant="ours"):
    """Values of a quantity in a variant, in order."""
    return results.query("quantity == @quantity and variant == @variant")["value"].tolist()


def test_a_cell_runs_all_stages_with_its_seeds_and_a_variant_those_that_it_changes(scripts):
    results = run_cell(NAME, DESCRIPTION, "5-7", scripts)
    assert list(results)[:2] == ["variant", "cell"]
    assert each(results, "cost") == [20] * 3  # a list of seeds gets all of them
    assert each(results, "cost", "published") == [200] * 3
    assert each(results, "runs", "published") == [1] * 3
    assert results["person"].tolist() == [5, 6, 7] * 4
    assert sorted(path.name for path in scripts.iterdir()) == ["dvc.yaml", "params.yaml", "stages"]
    with pytest.raises(InputError, match=r"cell 66: stages/toy/learn\.py: no such person"):
        run_cell(NAME, DESCRIPTION, "66", scripts)
    with pytest.raises(InputError, match=r"params\.yaml: key 'learn\.pace' is missing"):
        changed({"learn": {"steps": 4}}, {"learn.pace": 1})


def test_cells_are_joined_with_those_in_git(toy, capsys):
    study = run(toy, "10", "9")
    assert study.results["cell"].tolist() == ["9", "9", "10", "10"] * 2
    assert list(study.made.cells) == ["9", "10"]
    assert each(study.results, "cost") == [36, 40]
    assert each(study.results, "cost", "published") == [360, 400]
    (toy / "stages/toy/learn.py").write_text(LEARN.replace(*MORE_STEPS))
    with pytest.raises(InputError, match="cells of one study were made by different code"):
        run(toy, "10")
    assert each(run(toy, "9").results, "cost") == [37, 41]  # both by the other code
    own = study.made.cells["9"]
    more = {"8": (run_cell(NAME, DESCRIPTION, "8", toy), own)}
    assert list(joined(study, more, study.made.parameters, DESCRIPTION).made.cells) == ["8", "9", "10"]
    values = yaml.safe_load((toy / "params.yaml").read_text())
    (toy / "params.yaml").write_text(yaml.safe_dump(values | {"results": {"factor": 2}}))
    assert study_tables.moved_parameters(NAME, DESCRIPTION, study, toy) == ["results"]
    with pytest.raises(InputError, match=r"made with other parameters.*make studies NAME=toy/people"):
        check_study(NAME, DESCRIPTION, toy)
    alone = joined(study, more, made_with(NAME, DESCRIPTION, toy), DESCRIPTION)
    assert list(alone.made.cells) == ["8"]  # the others say nothing with these parameters
    later = {"8": (more["8"][0], LATER)}
    alone = joined(study, later, study.made.parameters, DESCRIPTION)
    assert list(alone.made.cells) == ["8"]  # nor those of other code
    with pytest.raises(InputError, match=r"different code: 8 by e4f5a6b; 7 by .+; run the older ones again"):
        joined(study, later | {"7": more["8"]}, study.made.parameters, DESCRIPTION)
    shutil.rmtree(toy / CELLS / NAME / "9")
    join_study(NAME, DESCRIPTION, toy)
    assert "toy/people: 9 of other code or parameters dropped; git has them" in capsys.readouterr().out
    (toy / CELLS / NAME / "10/cell.json").write_text("{}")
    with pytest.raises(InputError, match=r"cell\.json: cell\.commit: Field required"):
        join_study(NAME, DESCRIPTION, toy)


def test_a_study_is_read_whatever_its_parameters_and_damage_is_named(toy):
    assert read_study(NAME, toy / RESULTS) is None
    run(toy, "3")
    assert read_study(NAME, toy / RESULTS).made.parameters
    (toy / RESULTS / NAME / "results.parquet").write_text("variant,cost")
    with pytest.raises(InputError, match=r"results\.parquet: "):
        read_study(NAME, toy / RESULTS)


def test_a_cell_that_was_run_again_is_held_against_the_table(toy):
    study = run(toy, "9", "10")
    assert check_study(NAME, DESCRIPTION, toy) == []
    check = stored_study(toy / RESULTS / NAME).made.check
    assert (check.cell, check.compared, check.different) == ("10", 4, [])
    again = run_cell(NAME, DESCRIPTION, "9", toy)
    for change, different in ((0.0, []), (1e-15, ["cost"])):
        factor = np.where(again["quantity"] == "cost", 1.0 + change, 1.0)
        assert compare(again.assign(value=again["value"] * factor), study, "9", toy).different == different
    assert compare(again[again["quantity"] == "cost"], study, "9", toy).different == [
        "runs"
    ]  # lacks a quantity
    (toy / "stages/toy/learn.py").write_text(LEARN.replace(*MORE_STEPS))
    assert check_study(NAME, DESCRIPTION, toy) == ["toy/people: cost"]


ORIGIN, LATER = (
    Origin(commit=commit, code=commit, processor="here", minutes=2.0) for commit in ("a1b2c3d", "e4f5a6b")
)
CHECK = Check(cell="3", commit="0a1b2c3", compared=70, different=[])


@pytest.mark.parametrize(
    ("cells", "check", "made", "outcome"),
    [
        ([ORIGIN], None, "a1b2c3d", ""),
        ([ORIGIN, ORIGIN, LATER], {}, "a1b2c3d (2 cells: 1 to 2) and e4f5a6b (1 cell: 3)", "equal"),
        ([ORIGIN], {"different": ["cost"]}, "a1b2c3d", "cost differ"),
    ],
)
def test_a_study_says_by_whose_code_each_cell_was_made_and_which_was_run_again(cells, check, made, outcome):
    again = None if check is None else CHECK.model_copy(update=check)
    origins = {str(number): origin for number, origin in enumerate(cells, 1)}
    study = Study(pd.DataFrame(), StudyProvenance(parameters={}, seeds=[], cells=origins, check=again))
    told = f"; cell 3 repeated by 0a1b2c3: 70 numbers, {outcome}" if outcome else ", not repeated since"
    words = f"made by commit {made}{told}"
    assert provenance(study) == words
    assert rests_on(NAME, study) == f"Verdicts over populations rest on the study toy/people, {words}."
    assert rests_on(NAME, None) == ""


def test_the_commit_of_sources_says_whether_they_are_as_committed(tmp_path, monkeypatch):
    def git(*arguments):
        subprocess.run(["git", "-C", tmp_path, *arguments], check=True, capture_output=True)

    (tmp_path / "src").mkdir()
    (tmp_path / "src/one.py").write_text("x = 1")
    assert source_commit(["src"], tmp_path) == UNKNOWN_COMMIT  # unpacked from an archive
    git("init")
    assert source_commit(["src"], tmp_path) == UNKNOWN_COMMIT
    git("add", ".")
    git("-c", "user.name=a", "-c", "user.email=a@b", "commit", "-m", "one")
    commit = source_commit(["src"], tmp_path)
    assert len(commit) >= 7
    (tmp_path / "notes.txt").write_text("no source")
    (tmp_path / "src/dvc.lock").write_text("what the stages wrote")
    assert source_commit(["src"], tmp_path) == commit
    (tmp_path / "src/two.py").write_text("x = 2")
    assert source_commit(["src"], tmp_path) == f"{commit}+changes"
    assert source_commit(["src"], tmp_path / "src") == UNKNOWN_COMMIT  # within another project
    monkeypatch.setenv("PATH", "")
    assert source_commit(["src"], tmp_path) == UNKNOWN_COMMIT


@pytest.fixture
def planned(scripts, monkeypatch):
    """The project of two stages in git, with a study of three cells, the last of which fails."""
    folder = scripts / "stages/studies"
    (folder / ".dvc").mkdir(parents=True)
    (folder / ".dvc/config").write_text("[core]\n    analytics = false\n    no_scm = true\n")
    cmd = f"cd ../.. && {sys.executable} stages/studies/cell.py toy/people ${{item}}"
    outs = [{f"../../{CELLS}/{NAME}/${{item}}": {"cache": False}}]
    cells = {"foreach": [9, 10, 66], "do": {"cmd": cmd, "deps": ["../toy"], "outs": outs}}
    (folder / "dvc.yaml").write_text(yaml.safe_dump({"stages": {"toy_people": cells}}))
    (scripts / ".gitignore").write_text("data/\ndvc.lock\n.structlearn.yaml\ntmp/\n__pycache__/\nreports/\n")
    git(scripts, "init")
    commit(scripts, "a study")
    monkeypatch.chdir(scripts)
    monkeypatch.setattr(study_cells, "write_code", lambda *_: None)
    return scripts


def git(folder, *arguments):
    who = ("-c", "user.name=a", "-c", "user.email=a@b")
    subprocess.run(["git", "-C", folder, *who, *arguments], check=True, capture_output=True)


def commit(folder, message):
    git(folder, "add", ".")
    git(folder, "commit", "-m", message)


def test_all_cells_run_but_those_that_are_up_to_date_and_the_plan_says_how_long(planned, capsys):
    with pytest.raises(InputError, match=r"cell 66: stages/toy/learn\.py: no such person"):
        run_cells({NAME: DESCRIPTION}, [NAME], planned)
    said = capsys.readouterr().out
    assert "toy/people: 3 cells, never timed before\n3 cells to run, 1 at once\n" in said
    assert said.count("minutes\n") == 2  # the cells that did not fail
    made = json.loads((planned / CELLS / NAME / "9/cell.json").read_text())
    assert made["commit"] == source_commit(root=planned)
    assert "toy_people@9:" in (planned / "stages/studies/dvc.lock").read_text()
    join_study(NAME, DESCRIPTION, planned)
    with pytest.raises(InputError, match="cell 66"):
        run_cells({NAME: DESCRIPTION}, [NAME], planned)
    again = capsys.readouterr().out
    assert "toy/people: 1 cell, about 0 minutes each\n1 cell to run, 1 at once, about 0.0 h\n" in again

    (planned / "stages/toy/learn.py").write_text(LEARN.replace(*MORE_STEPS))
    with pytest.raises(InputError, match=r"cell 9: the sources differ from commit \w+: commit them first"):
        run_cells({NAME: DESCRIPTION}, [NAME], planned)
    commit(planned, "more steps")
    with pytest.raises(InputError, match="cell 66"):
        run_cells({NAME: DESCRIPTION}, [NAME], planned)
    assert json.loads((planned / CELLS / NAME / "9/cell.json").read_text())["at_once"] == 1
    join_study(NAME, DESCRIPTION, planned)
    assert each(stored_study(planned / RESULTS / NAME).results, "cost") == [37, 41]


@pytest.fixture
def two_workers(planned):
    """A scheduler and two Dask workers, started in the project's folder."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{one.getsockname()[1]}"
    scheduler = ["scheduler", "--host", "127.0.0.1", "--port", address.rpartition(":")[2], "--no-dashboard"]
    worker = ["worker", address, "--no-nanny", "--no-dashboard", "--nthreads", "1"]
    path = os.pathsep.join(str(ROOT / part) for part in ("src", "tests"))
    with ExitStack() as ends:
        for name, *its in (scheduler, worker, worker):
            command = [sys.executable, "-m", f"distributed.cli.dask_{name}", *its]
            process = subprocess.Popen(
                command, cwd=planned, env=os.environ | {"PYTHONPATH": path}, stderr=subprocess.DEVNULL
            )
            ends.callback(process.wait)
            ends.callback(process.kill)
        yield address


def test_a_cell_runs_again_when_its_worker_is_killed(planned, two_workers, monkeypatch, capsys):
    """Two workers; the first that runs person 66 is killed, and the other does the rest."""
    deadly = LEARN.replace("    raise SystemExit('no such person')\n", KILL.format(folder=planned))
    (planned / "stages/toy/learn.py").write_text(deadly)
    commit(planned, "a person who ends the first worker")
    monkeypatch.setenv(parallel.BACKEND, "dask")
    monkeypatch.setattr(parallel, "WORKERS_S", 30.0)
    with dask.config.set({"scheduler-address": two_workers}):
        try:
            Client(two_workers).wait_for_workers(2)
            run_cells({NAME: DESCRIPTION}, [NAME], planned)
        finally:
            Client.current().close()
    said = capsys.readouterr().out
    assert "3 cells to run, 2 at once" in said
    assert (planned / "killed").exists()
    assert sorted(path.name for path in (planned / CELLS / NAME).iterdir()) == ["10", "66", "9"]
    join_study(NAME, DESCRIPTION, planned)
    study = stored_study(planned / RESULTS / NAME)
    assert each(study.results, "cost") == [36, 40, 264]
    assert study.made.at_once == [2]


def test_a_worker_with_other_code_adds_no_cell(planned, monkeypatch):
    make = study_cells.make_cell

    def elsewhere(name, description, cell, root):
        results, origin = make(name, description, cell, root)
        return results, origin.model_copy(update={"commit": "0a1b2c3", "code": "other"})

    monkeypatch.setattr(study_cells, "make_cell", elsewhere)
    with pytest.raises(InputError, match="cell 9: made by a worker with other code, of 0a1b2c3"):
        run_cells({NAME: DESCRIPTION}, [NAME], planned)
    assert not (planned / CELLS / NAME / "9").exists()


DESCRIPTIONS = read_descriptions(ROOT / study_cells.DESCRIPTIONS)
POPULATIONS = {"obstacles": "obstacle_people", "dynamics": "dynamics_robots", "servoing": "servo_people"}
POPULATIONS |= {"rivals": "scraping_people"}
PAST_SPHERES = {"rivals/reaching", "rivals/reaching_choice"}
CHOOSING = {"rivals/choice", "rivals/reaching_choice"}  # on people for tuning alone


@pytest.mark.parametrize("name", DESCRIPTIONS)
def test_every_study_names_what_is_there_and_nobody_on_whom_constants_were_chosen(name, root: Path):
    description, testbed = DESCRIPTIONS[name], name.partition("/")[0]
    planned = read_yaml(root / "stages/studies/dvc.yaml")["stages"][name.replace("/", "_")]
    parameters = read_yaml(root / "params.yaml")
    for variant in description.variants.values():
        changed(parameters, dict.fromkeys(description.seeds, 1) | variant.parameters)
        assert variant.first in description.stages
    upstream = set(made_with(name, description, root))
    params = {file: set(keys) for one in planned["do"]["params"] for file, keys in one.items()}
    assert params["../../params.yaml"] == upstream
    scripts = [root / f"stages/{testbed}/{stage}.py" for stage in description.stages]
    houses = (code_digests.LIBRARY, study_cells.REPRODUCTION)
    assert params[".structlearn.yaml"] == {
        code_digests.code_key(package, house)
        for package in packages(root / "stages/studies/cell.py", *scripts)
        for house in houses
        if package.is_relative_to(house)
    }
    assert set(planned["do"]["deps"]) == {"cell.py", f"../{testbed}"}
    assert planned["do"]["outs"] == [{f"../../{CELLS}/{name}/${{item}}": {"cache": False}}]
    kind = "obstacle_people" if name in PAST_SPHERES else POPULATIONS.get(testbed, f"{testbed}_people")
    population = parameters[kind]
    seeds = [seed for cell in planned["foreach"] for seed in seeds_of(str(cell))]
    assert len(set(seeds)) == len(seeds)
    if name in CHOOSING:
        assert set(seeds) <= set(population["tuning"])
    else:
        assert not set(seeds) & set(population["tuning"])
    if (root / RESULTS / name / "study.json").exists():
        study = read_study(name)
        assert study_tables.moved_parameters(name, description, study, root) == []
        assert set(study.made.cells) <= {str(cell) for cell in planned["foreach"]}
        assert study.made.check is None or study.made.check.different == []
        assert set(study.results["variant"]) == {"ours", *description.variants}
        assert set(study.results["cell"]) == set(study.made.cells)


def test_the_page_lists_every_study(root, monkeypatch):
    monkeypatch.chdir(root)
    page = study_tables.studies_page(DESCRIPTIONS)
    for made in root.glob(f"{RESULTS}/*/*/study.json"):
        name = made.parent.relative_to(root / RESULTS).as_posix()
        assert name in page
        assert f'href="{name}/results.parquet"' in page
        assert provenance(stored_study(made.parent))[5:30] in page


def test_a_study_that_was_run_without_numbers_says_so(tmp_path):
    write_table(pd.DataFrame({"variant": ["ours"], "cell": ["1"]}), tmp_path / "results.parquet")
    (tmp_path / "study.json").write_text('{"parameters": {}}')
    with pytest.raises(InputError, match=r"study\.json: .*cells: Field required"):
        stored_study(tmp_path)
