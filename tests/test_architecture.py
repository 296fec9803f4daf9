"""Imports run downwards only, big libraries stay in their rooms, stages depend on their code and data."""

import ast
import runpy
import subprocess
import sys
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

import pytest
from committed import ROOT, read_yaml

from dissertation.evidence.claims import QUOTED
from structlearn.core.source_closure import SourceTree

PACKAGE = ROOT / "src" / "structlearn"
FLOORS = (
    ("core",),
    ("networks", "readers"),
    ("primitives", "rigid_body", "tactile"),
    ("segmentation", "feedback"),
    ("policy_search", "avoidance"),
    ("simulation",),
    ("reporting", "viewer"),
    ("testbeds", "tasks"),
)
PROGRAMS = {path.stem for path in PACKAGE.glob("*.py") if "__main__" in path.read_text()}
"""That a user calls, e.g. `python -m structlearn.verify`."""

ROOMS = {
    "rerun": ("viewer", "views", "view"),
    "matplotlib": ("reporting", "page", "section", "figures"),
    "pybullet": ("simulation", "world"),
    "pinocchio": ("simulation", "world", "rigid_body", "readers"),
    "torch": ("networks", "feedback", "rigid_body", "tactile"),
    "mcap": ("readers",),
}
SLOW = (
    *("torch", "pybullet", "pinocchio", "sklearn", "cma", "matplotlib", "rerun", "distributed"),
    *("scipy.stats", "scipy.signal", "scipy.optimize", "scipy.interpolate", "scipy.ndimage"),
)
"""Libraries that take up to one and a half seconds to load, and which few stages need."""

STARTS = {
    "pinocchio": "scraping/record_nominal scraping/expected_traces scraping/record_corrections "
    "scraping/evaluate_feedback scraping/refine scraping/evaluate_refinement scraping/compare_search "
    "scraping/time_controller dynamics/record_motion tasks/check engines dynamics/train "
    "dynamics/online dynamics/track dynamics/view scraping/report dynamics/report",
    "pybullet": "engines obstacles/report servoing/report scraping/loop scraping/report dynamics/report",
    "torch": "scraping/train_feedback scraping/compare_models obstacles/train servoing/train_latent "
    "servoing/servo servoing/other_skins dynamics/train dynamics/online dynamics/track dynamics/view "
    "dynamics/report",
    "rerun": "scraping/view obstacles/view servoing/view tasks/view dynamics/view",
    "matplotlib": "tasks/report tasks/recorded_report tasks/calibration_report obstacles/report "
    "servoing/report scraping/loop scraping/report dynamics/report",
}  # fmt: skip
"""By slow library: the scripts that may load it when they start."""

COPIED = {"claims.csv": "tables/claims.csv", "metrics.json": "metrics.json", "findings.csv": "findings.csv"}
"""What `make recorded` puts aside of the report on recorded data."""

PIPELINES = ("dvc.yaml", "stages/tasks/dvc.yaml", "stages/studies/dvc.yaml")
LISTED = [read_yaml(ROOT / pipeline)["stages"] for pipeline in PIPELINES]
CODE = {stages["code"]["cmd"].split()[2]: stages.pop("code") for stages in LISTED}
"""The stages that list the code of all others, by pipeline."""

scripts: Callable[[str], Iterable[Path]] = runpy.run_path(str(ROOT / "stages/list_code.py"))["scripts"]

STAGES = {
    stage["cmd"].split()[1]: stage
    for stages in LISTED
    for listed in stages.values()
    for stage in [listed.get("do", listed)]
}
"""Of all pipelines by their scripts: some names stand in several. Those of your own tasks are one for all."""


@cache
def imported(path: Path) -> frozenset[str]:
    """Every name that a file imports, at its top or inside its functions; `package.name` for each name."""
    return named(ast.walk(ast.parse(path.read_text())))


@cache
def at_start(path: Path) -> frozenset[str]:
    """What importing a file imports: outside functions, and not for type checkers."""
    return named(ast.parse(path.read_text()).body)


def named(nodes: Iterable[ast.AST]) -> frozenset[str]:
    """Names that statements import."""
    names = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return frozenset(names)


def modules() -> dict[Path, frozenset[str]]:
    """Every module of the package, relative to it, with the names that it imports."""
    return {path.relative_to(PACKAGE): imported(path) for path in sorted(PACKAGE.rglob("*.py"))}


@cache
def files(name: str) -> list[Path]:
    """The project's files that importing a dotted name runs: the module, and the packages above it."""
    parts = name.split(".")
    above = [ROOT.joinpath("src", *parts[:depth], "__init__.py") for depth in range(1, len(parts) + 1)]
    return [file for file in (*above, ROOT.joinpath("src", *parts).with_suffix(".py")) if file.is_file()]


def loaded_at_start(script: Path) -> set[Path]:
    """All of the project's own files that starting a script loads."""
    found, waiting = {script}, [script]
    while waiting:
        for file in {file for name in at_start(waiting.pop()) for file in files(name)} - found:
            found.add(file)
            waiting.append(file)
    return found


def floor(room: str) -> int:
    """Height of a package; of the modules beside the packages, programs stand above all, others below."""
    beside = len(FLOORS) + (room == "command") if room in PROGRAMS else 0  # `structlearn inspect` runs one
    return next((height for height, rooms in enumerate(FLOORS) if room in rooms), beside)


def test_imports_run_downwards():
    for path, names in modules().items():
        room = path.parts[0] if len(path.parts) > 1 else path.stem.strip("_")
        for name in names:
            parts = name.split(".")
            if parts[0] == "structlearn" and len(parts) > 1 and floor(parts[1]) > 0:
                same = parts[1] == room
                assert same or floor(parts[1]) < floor(room), f"{path} imports {name}"


def test_no_testbed_imports_another_and_computing_knows_nothing_of_pages_and_recordings():
    for path, names in modules().items():
        assert not {"pickle", "torch.save"} & names, path
        if path.parts[0] == "testbeds" and len(path.parts) > 2:
            others = {name.split(".")[2] for name in names if name.startswith("dissertation.")}
            assert others <= {path.parts[1]}, f"{path} imports another testbed"
        if {"world", "protocol"} & set(path.parts):
            shown = {"page", "recordings", "views"}
            assert not any(shown & set(name.split(".")[3:4]) for name in names if "testbeds" in name), path


def test_big_libraries_stay_in_their_rooms():
    for path, names in modules().items():
        for library, rooms in ROOMS.items():
            if any(name.split(".")[0] == library for name in names):
                room = {*path.parts, path.stem.rpartition("_")[2]}  # of tasks, by the end of the name
                assert set(rooms) & room, f"{path} imports {library}"


def test_a_module_name_means_one_thing():
    """Modules of one name are the same part of different testbeds."""
    places: dict[str, list[Path]] = {}
    for path in modules():
        if path.name not in ("__init__.py", "findings.py"):  # of a page, and the kit for them in `reporting`
            places.setdefault(path.name, []).append(path)
    for paths in places.values():
        parts = {
            ("testbeds", *path.parts[2:]) if path.parts[0] == "testbeds" else path.parts for path in paths
        }
        assert len(parts) == 1, paths


@pytest.mark.parametrize("name", STAGES)
def test_a_stage_depends_on_its_script_and_on_its_list_of_code(name):
    place = Path(name).relative_to("stages").with_suffix(".txt")
    lists = ("data/code" if place.parts[0] in ("tasks", "studies") else "data/code/main") / place
    deps = STAGES[name]["deps"]
    assert deps[:2] == [name, lists.as_posix()]
    beside = [dep for dep in deps[2:] if dep.startswith(("src/", "stages/"))]
    # what pages read beside their code: words, and claims about public sets
    read = {"stages/report.py": ["stages/report.yaml"], "stages/tasks/report.py": ["stages/tasks/claims"]}
    read["stages/studies/cell.py"] = ["stages/scraping"]  # the last of the studies: whose stages it runs
    assert beside == read.get(name, [])


def test_the_lists_of_code_have_every_script_and_every_file_of_the_package():
    """Modules in none are programs that a user calls; of other files there is the type marker."""
    sources = SourceTree(PACKAGE.parent)
    found = {script: sources.closure(script) for pipeline in CODE for script in scripts(pipeline)}
    assert {script.relative_to(ROOT).as_posix() for script in found} == set(STAGES)
    used = {path for its in found.values() for path in its}
    files = {
        path.relative_to(PACKAGE.parent) for path in PACKAGE.rglob("*.*") if "__pycache__" not in path.parts
    }
    unused = {path.as_posix() for path in files - used if path.suffix not in (".py", ".pyi")}
    assert unused == {"structlearn/py.typed"}


def test_the_stages_of_code_depend_on_every_script():
    for pipeline, stage in CODE.items():
        deps = [ROOT / dep for dep in stage["deps"]]
        assert PACKAGE in deps
        assert all(any(script.is_relative_to(dep) for dep in deps) for script in scripts(pipeline))
        assert stage["outs"] == [f"data/code/{pipeline}"]


def test_every_data_dependency_is_the_output_of_some_stage():
    outputs = {f"reports/studies/{folder.name}" for folder in (ROOT / "reports/studies").iterdir()}
    outputs |= {"params.yaml", *((QUOTED / name).as_posix() for name in COPIED)}
    public = read_yaml(ROOT / "stages/tasks/public.yaml")
    for stage in (stage for stages in LISTED for stage in stages.values()):
        tasks = public[stage["foreach"][2:-1]] if isinstance(stage.get("foreach"), str) else ()
        for out in [*stage.get("do", stage).get("outs", []), *stage.get("metrics", [])]:
            path = out if isinstance(out, str) else next(iter(out))
            outputs |= {path, *(path.replace("${key}", task) for task in tasks)}
    for stage in STAGES.values():
        data = {dep for dep in stage["deps"] if not dep.startswith(("src/", "stages/", "data/code/"))}
        assert {dep.removesuffix("/claims.csv") if "tables" in dep else dep for dep in data} <= outputs


def test_what_is_quoted_of_recorded_data_is_what_its_report_says():
    for name, source in COPIED.items():
        assert (ROOT / QUOTED / name).read_bytes() == (ROOT / "reports/recorded" / source).read_bytes()


def test_stages_start_without_what_they_do_not_need():
    """Whoever needs a slow library in one function alone imports it there."""
    for script in (*STAGES, "stages/list_code.py"):
        names = {name for file in loaded_at_start(ROOT / script) for name in at_start(file)}
        loaded = {library for library in SLOW for name in names if f"{name}.".startswith(f"{library}.")}
        place = script.removeprefix("stages/").removesuffix(".py")
        allowed = {library for library, its in STARTS.items() if place in its.split()}
        assert loaded <= allowed, f"{script} loads {loaded - allowed}"
    assert "pandas" not in {
        name for file in loaded_at_start(PACKAGE / "core/stage.py") for name in at_start(file)
    }


def test_no_stage_hands_a_function_of_its_own_to_other_processes():
    """Processes may outlive a stage, and find functions by their module."""
    for script in (ROOT / "stages").rglob("*.py"):
        tree = ast.parse(script.read_text())
        own = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
        handed = {
            argument.id
            for call in calls
            if getattr(call.func, "id", "") in ("partial", "parallel_map")
            for argument in call.args[:1]
            if isinstance(argument, ast.Name)
        }
        assert not own & handed, f"{script.name} hands over {own & handed}"


FACES = """
import importlib, sys
faces = [importlib.import_module(name) for name in sys.argv[1:]]
for face in faces:
    loaded = [one for one in sys.modules if one.startswith(f"{face.__name__}.")]
    assert not loaded and face.__all__, loaded
for face in faces:
    for one in face.__all__:
        getattr(face, one)
"""


def test_what_users_import_is_there_and_loads_nothing_before_it_is_used():
    names = [f"structlearn.{face.parent.name}" for face in sorted(PACKAGE.glob("*/__init__.pyi"))]
    assert len(names) > 5
    subprocess.run([sys.executable, "-c", FACES, *names], check=True)
