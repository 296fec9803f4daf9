"""Imports run downwards only, big libraries stay in their rooms, stages depend on their code and data."""

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
from committed import ROOT, read_yaml
from import_graph import closure, code_of, imported, module_of, modules, named

from dissertation.evidence.claims import QUOTED

LIBRARY, REPRODUCTION = "structlearn", "dissertation"
SOURCES = ROOT / "src"
FLOORS = {
    LIBRARY: (
        ("core", "palette"),
        ("networks", "readers"),
        ("primitives", "rigid_body", "tactile"),
        ("segmentation", "feedback"),
        ("policy_search", "avoidance"),
        ("reporting", "viewer"),
        ("tasks", "verify"),
        ("command",),
        ("__main__",),
    ),
    REPRODUCTION: (
        ("simulation", "evidence"),
        ("scraping", "obstacles", "dynamics", "servoing", "recorded"),
        ("rivals",),
    ),
}
"""Packages of each house from the ground floor up; the reproduction stands on the library's."""

TESTBEDS = ("scraping", "obstacles", "dynamics", "servoing")
PARTS = ("world", "protocol", "page", "recordings")
KIND = ("parameters", "recordings", "learning", "page", "view")
"""Modules of a kind of tasks, see `structlearn.tasks.kinds`."""

ROOMS = {
    "rerun": ("viewer", "recordings", "view"),
    "matplotlib": ("reporting", "page", "section", "figures"),
    "pybullet": ("simulation", "world"),
    "pinocchio": ("simulation", "world", "rigid_body", "readers"),
    "torch": ("networks", "feedback", "rigid_body", "tactile", "rivals"),
    "mcap": ("readers",),
}
SORTS = ("sort_values", "sort_index", "argsort")
ESTIMATED = (
    *("sqrt", "log", "tan", "atan", "arctan", "acos", "arccos", "asin", "arcsin", "pow", "float_power"),
    *(
        "cholesky",
        "qr",
        "eigh",
        "eigvalsh",
        "eig",
        "eigvals",
        "svd",
        "svdvals",
        "lstsq",
        "pinv",
        "matrix_rank",
    ),
)
"""Functions of tensors that `benchmarks/processor_bits.py` finds to differ, and those that call them."""

SLOW = (
    *("torch", "pybullet", "pinocchio", "sklearn", "cma", "matplotlib", "rerun", "distributed"),
    *("scipy.stats", "scipy.signal", "scipy.optimize", "scipy.interpolate", "scipy.ndimage"),
)
"""Libraries that take up to one and a half seconds to load, and which few stages need."""

STARTS = {
    "pinocchio": "scraping/record_nominal scraping/expected_traces scraping/record_corrections "
    "scraping/evaluate_feedback scraping/refine scraping/evaluate_refinement scraping/compare_search "
    "dynamics/record_motion tasks/check engines dynamics/train "
    "dynamics/online dynamics/track dynamics/view scraping/report dynamics/report "
    "scraping/results dynamics/results",
    "pybullet": "engines",
    "torch": "servoing/train_latent servoing/servo servoing/other_skins dynamics/train dynamics/online "
    "dynamics/track dynamics/view dynamics/report",
    "rerun": "scraping/view obstacles/view servoing/view tasks/view dynamics/view",
    "matplotlib": "tasks/report tasks/recorded_report obstacles/report "
    "servoing/report scraping/report dynamics/report report",
}  # fmt: skip
"""By slow library: the scripts that may load it when they start."""

COPIED = {name: name for name in ("metrics.json", "findings.csv")}
COPIED |= {name: f"tables/{name}" for name in ("claims.csv", "people.csv")}
"""What `make recorded` puts aside of the report on recorded data."""

PIPELINE = read_yaml(ROOT / "dvc.yaml")["stages"]
SCRIPTS = {stage["cmd"].split()[1]: stage for stage in PIPELINE.values()}
"""Stages of the pipeline by their scripts."""


@cache
def at_start(path: Path) -> frozenset[str]:
    """What importing a file imports: outside functions, and not for type checkers."""
    return frozenset(named(ast.parse(path.read_text()).body))


def loaded_at_start(script: Path) -> set[Path]:
    """All of the project's own files that starting a script loads."""
    found, waiting = {script}, [script]
    while waiting:
        for file in {file for name in at_start(waiting.pop()) for file in files(name)} - found:
            found.add(file)
            waiting.append(file)
    return found


@cache
def files(name: str) -> list[Path]:
    """The project's files that importing a dotted name runs: its module, and the packages above that."""
    module = module_of(name)
    if module is None:
        return []
    parts = module.split(".")
    return [modules()[".".join(parts[:depth])] for depth in range(1, len(parts) + 1)]


@cache
def names_in(path: Path) -> set[str]:
    """All names that a file imports."""
    return set(named(ast.walk(ast.parse(path.read_text()))))


def calls(path: Path) -> list[ast.Call]:
    """All calls in a file."""
    return [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)]


def floor(module: str) -> int:
    """Height of the package that a module is in."""
    house, room = module.split(".")[:2]
    return next(height for height, rooms in enumerate(FLOORS[house]) if room in rooms)


def test_imports_run_downwards():
    for module, path in modules().items():
        for other in imported(path):
            if "." not in module or "." not in other:
                continue
            house, room = module.split(".")[:2]
            if other.startswith(f"{REPRODUCTION}."):
                assert house == REPRODUCTION, f"the library imports the reproduction: {module}, {other}"
            if other.split(".")[0] == house and other.split(".")[1] != room:
                assert floor(other) < floor(module), f"{module} imports {other}"


def test_no_testbed_imports_another_and_computing_knows_nothing_of_pages_and_recordings():
    for module, path in modules().items():
        names, (house, *rooms) = names_in(path), module.split(".")
        assert not {"pickle", "torch.save"} & names, path
        if house == REPRODUCTION and rooms[:1] and rooms[0] in TESTBEDS:
            others = {one.split(".")[1] for one in imported(path) if one.startswith(f"{house}.")}
            assert not others & (set(TESTBEDS) - {rooms[0]}), f"{path} imports another testbed"
            parts = {one.split(".")[2] for one in imported(path) if one.startswith(f"{house}.{rooms[0]}.")}
            if rooms[1:2] in (["world"], ["protocol"]):
                assert not parts & {"page", "recordings"}, path


def test_pages_and_recordings_are_imported_by_show_stages_alone():
    for script in SCRIPTS:
        shown = {module.split(".")[2] for module in closure(ROOT / script) if module.count(".") > 2}
        if Path(script).stem not in ("report", "view", "loop"):
            assert not shown & {"page", "recordings"}, script


def importing(module: str) -> set[str]:
    """Modules that a module imports, also by way of others; what is looked up by name aside."""
    found: set[str] = set()
    waiting = set(imported(modules()[module]))
    while waiting:
        found |= waiting
        waiting = {other for one in waiting for other in imported(modules()[one])} - found
    return found


def test_no_module_imports_itself_by_way_of_others():
    """Also for type checkers or inside functions."""
    assert {module for module in modules() if module in importing(module)} == set()


def test_big_libraries_stay_in_their_rooms():
    for path in modules().values():
        for library, rooms in ROOMS.items():
            if any(name.split(".")[0] == library for name in names_in(path)):
                room = {*path.relative_to(SOURCES).parts, path.stem, path.stem.rpartition("_")[2]}
                assert set(rooms) & room, f"{path} imports {library}"


@pytest.mark.parametrize("folder", ["src", "stages", "benchmarks", "examples"])
def test_sorts_are_stable(folder):
    """Kernels of some processors leave ties in another order."""
    for path in (ROOT / folder).rglob("*.py"):
        for call in calls(path):
            if getattr(call.func, "attr", "") in SORTS:
                kinds = [ast.unparse(word.value) for word in call.keywords if word.arg == "kind"]
                assert kinds == ["'stable'"], f"{path}, line {call.lineno}"


def test_no_tensor_meets_a_kernel_whose_digits_depend_on_the_processor():
    """`networks.torch_settings.square_root` and numpy's functions do not; `** 0.5` is a root to torch."""
    for path in modules().values():
        if any(name.split(".")[0] == "torch" for name in names_in(path)):
            for call in calls(path):
                name, owner = getattr(call.func, "attr", ""), ast.unparse(getattr(call.func, "value", call))
                assert name.strip("_") not in ESTIMATED or owner.split(".")[0] in ("np", "math", "scipy"), (
                    f"{path}, line {call.lineno}: {name} of a tensor"
                )
            for node in ast.walk(ast.parse(path.read_text())):
                root = isinstance(node, ast.BinOp) and ast.unparse(node.right) == "0.5"
                assert not (root and isinstance(node.op, ast.Pow)), f"{path}, line {node.lineno}: a root"


def test_a_module_name_means_one_thing():
    """Modules of one name are the same part of different testbeds, or of kinds of tasks."""
    places: dict[str, list[Path]] = {}
    for path in modules().values():
        trains = path.is_relative_to(SOURCES / LIBRARY / "feedback/training")  # the network of the same name
        stage = path.is_relative_to(SOURCES / LIBRARY / "tasks/stages")  # named after what it makes
        if (
            path.name not in ("__init__.py", "findings.py", "claims.py", "results.py")
            and not trains
            and not stage
        ):
            places.setdefault(path.name, []).append(path.relative_to(SOURCES))
    for paths in places.values():
        kinds = [path for path in paths if path.parts[1] in ("tasks", "recorded") and path.stem in KIND]
        others = {*paths} - ({*kinds} if paths[0].stem in KIND else set())
        parts = {("testbed", *path.parts[2:]) if path.parts[1] in TESTBEDS else path.parts for path in others}
        assert len(parts) <= 1, paths


def code_deps(script: str) -> set[str]:
    """The script of a stage, and the package folders that it uses, a testbed's part by part."""
    used = code_of(ROOT / script)
    parts = {path for path in code_of(ROOT / script, depth=3) if path.parts[1] in TESTBEDS}
    whole = {path for path in used if path.parts[1] not in TESTBEDS}
    return {script, *(f"src/{path.as_posix()}" for path in whole | parts)}


@pytest.mark.parametrize("script", SCRIPTS)
def test_a_stage_depends_on_its_script_and_on_the_code_that_it_uses(script):
    """All of it, and no other."""
    deps = SCRIPTS[script]["deps"]
    beside = {"stages/report.py": {"stages/report.yaml"}}.get(script, set())  # words of the front page
    assert deps[0] == script
    assert {dep for dep in deps if dep.startswith(("src/", "stages/"))} - beside == code_deps(script)


def test_every_module_is_used():
    """By a stage, by a command, or by a lab's task."""
    programs = [path for path in modules().values() if "__main__" in path.read_text()]
    tasks = [path for path in modules().values() if path.parent.name == "stages" or path.stem in KIND]
    scripts = [*(ROOT / "stages").rglob("*.py"), *programs, *tasks]
    used = {module for script in scripts for module in closure(script)}
    used |= {module for module, path in modules().items() if path in [*programs, *tasks]}
    used |= {module for module, path in modules().items() if path.name == "__init__.py"}
    looked_up = (
        "structlearn.feedback.models.",
        "structlearn.feedback.training.",
        "dissertation.recorded.readers.",
        "structlearn.readers.",
    )
    assert {module for module in set(modules()) - used if not module.startswith(looked_up)} == set()


def test_every_data_dependency_is_the_output_of_some_stage():
    outputs = {f"reports/studies/{folder.name}" for folder in (ROOT / "reports/studies").iterdir()}
    outputs |= {"params.yaml", *((QUOTED / name).as_posix() for name in COPIED)}
    outputs.add("reports/rivals/tables")  # from studies, by a script that is run by hand
    for stage in PIPELINE.values():
        listed = [*stage.get("outs", []), *stage.get("metrics", [])]
        outputs |= {out if isinstance(out, str) else next(iter(out)) for out in listed}
    for stage in PIPELINE.values():
        data = {dep for dep in stage["deps"] if not dep.startswith(("src/", "stages/"))}
        assert {dep.removesuffix("/claims.csv") if "tables" in dep else dep for dep in data} <= outputs


def test_what_is_quoted_of_recorded_data_is_what_its_report_says():
    for name, source in COPIED.items():
        assert (ROOT / QUOTED / name).read_bytes() == (ROOT / "reports/recorded" / source).read_bytes()


def test_stages_start_without_what_they_do_not_need():
    """Whoever needs a slow library in one function alone imports it there."""
    for script in SCRIPTS:
        names = {name for file in loaded_at_start(ROOT / script) for name in at_start(file)}
        loaded = {library for library in SLOW for name in names if f"{name}.".startswith(f"{library}.")}
        place = script.removeprefix("stages/").removesuffix(".py")
        allowed = {library for library, its in STARTS.items() if place in its.split()}
        assert loaded <= allowed, f"{script} loads {loaded - allowed}"
    assert "pandas" not in {
        name for file in loaded_at_start(SOURCES / LIBRARY / "core/stage.py") for name in at_start(file)
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
    names = [f"structlearn.{face.parent.name}" for face in sorted((SOURCES / LIBRARY).glob("*/__init__.pyi"))]
    assert len(names) > 5
    subprocess.run([sys.executable, "-c", FACES, *names], check=True)
