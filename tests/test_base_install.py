"""What is installed where: the base runs a skill, `learn` serves a lab, `reproduction` the clone."""

import ast
import re
import sys
import tomllib
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

import pytest
from faults import forged_skills
from import_graph import SOURCES, modules, named
from wheels import SITE, build, install, run

OWN = ("structlearn", "dissertation")
PROVIDES = {"pinocchio": ["pin"]}  # from a folder of its own
OPTIONAL = ("bags", "cluster")  # extras that the library asks for where it uses them
RUN = """
import sys
from structlearn.feedback import Controller, read_skill

skill = read_skill(sys.argv[1])
controller, first = Controller(skill, rate_hz=100.0), skill.primitives[0]
controller.start(first.position.start, first.orientation.start)
corrected = False
while not controller.finished:
    controller.tick([controller.time] * skill.channels)
    corrected |= controller.coupling.any()
print(controller.primitive == len(skill.primitives) - 1, corrected)
print(*(name for name in sys.modules if name.startswith("structlearn.")))
print(*{name.partition(".")[0] for name in sys.modules})
"""


def requirements(*extras: str) -> set[str]:
    """Distributions that `pyproject.toml` names for an installation with extras."""
    project = tomllib.loads((SOURCES.parent / "pyproject.toml").read_text())["project"]
    found = set()
    for line in [
        *project["dependencies"],
        *(one for its in extras for one in project["optional-dependencies"][its]),
    ]:
        if own := re.fullmatch(r"structlearn\[(.*)\]", line):
            found |= requirements(*own[1].split(","))
        else:
            found.add(as_named(line))
    return found


def as_named(requirement: str) -> str:
    """Normalised name of a distribution that is required."""
    return re.sub(r"[-_.]+", "-", re.split(r"[^\w.-]", requirement)[0]).lower()


def installed(names: set[str]) -> set[str]:
    """Those distributions, and what they require on this machine, by normalised name."""
    found: set[str] = set()
    waiting = set(names)
    while waiting:
        name = waiting.pop()
        found.add(name)
        lines = metadata.requires(name) or ()
        waiting |= {as_named(line) for line in lines if ";" not in line} - found
    return found


def undeclared(files: Iterable[Path], declared: set[str]) -> set[str]:
    """Packages that files import, at any depth, and that no declared distribution provides."""
    known = metadata.packages_distributions() | PROVIDES
    found = {
        name.partition(".")[0] for file in files for name in named(ast.walk(ast.parse(file.read_text())))
    }
    others = found - sys.stdlib_module_names - set(OWN)
    return {name for name in others if not {as_named(owner) for owner in known.get(name, [])} & declared}


@pytest.fixture(scope="module")
def environment(root, tmp_path_factory) -> Path:
    """An environment with the wheel and what its base requires."""
    folder = tmp_path_factory.mktemp("base")
    files = [file for name in installed(requirements()) for file in metadata.files(name) or ()]
    packages = {SITE / file.parts[0] for file in files if file.parts[0] not in ("..", "__pycache__")}
    install(build(root, tmp_path_factory.mktemp("wheel")), folder, packages)
    return folder


def test_the_base_reads_a_skill_and_ticks_it_with_declared_packages_only(environment, tmp_path):
    skill = tmp_path / "skill.safetensors"
    forged_skills.write(skill)
    reached, ours, loaded = run(tmp_path, environment / "bin/python", "-c", RUN, skill).splitlines()
    assert reached == "True True"
    known = metadata.packages_distributions()
    owners = {as_named(owner) for name in loaded.split() for owner in known.get(name, ()) if owner != OWN[0]}
    assert owners <= installed(requirements())
    assert not owners & (requirements("reproduction") - requirements())
    files = {modules()[name] for name in ours.split()}
    assert {"runtime.py", "skill_file.py", "pmnn.py"} <= {file.name for file in files}
    assert undeclared(files, requirements()) <= {"pandas", "pyarrow"}  # of tables, inside their functions


def test_without_the_extra_the_command_says_what_to_install(environment, tmp_path):
    said = run(tmp_path, environment / "bin/structlearn", "run", code=1)
    assert said == "error: structlearn run needs the extra `learn`: pip install 'structlearn[learn]'\n"
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize(
    ("package", "extras"),
    [("structlearn", ("learn", *OPTIONAL)), ("dissertation", ("reproduction", *OPTIONAL))],
)
def test_every_import_is_declared(package, extras):
    assert undeclared((SOURCES / package).rglob("*.py"), requirements(*extras)) == set()


def test_the_clone_installs_all():
    assert requirements("dev") >= requirements("learn", "reproduction", "bags")
    heavy = {
        "torch",
        "dvc",
        "pandas",
        "pyarrow",
        "rerun-sdk",
        "pin",
        "pybullet",
        "matplotlib",
        "scikit-learn",
    }
    assert heavy <= requirements("dev")
    assert not heavy & installed(requirements())
