"""PYTHONPATH of a shell in which ROS was sourced: other packages come before those of this environment."""

import os
import subprocess
import sys

import pytest

from structlearn.core import shadowing
from structlearn.core.errors import InputError

STAGE = "from structlearn.core.stage import run\nrun(lambda: print('done'))\n"


@pytest.fixture
def ros(tmp_path):
    """A folder with packages of its own, and a plugin for pytest that needs a module that is not there."""
    folder = tmp_path / "ros/lib/python3.10/site-packages"
    info = folder / "launch_testing-1.0.egg-info"
    for path in (folder / "rclpy", folder / "launch_testing", info):
        path.mkdir(parents=True)
    (folder / "rclpy/__init__.py").touch()
    (folder / "launch_testing/__init__.py").write_text("import not_installed_anywhere\n")
    (info / "PKG-INFO").write_text("Metadata-Version: 2.1\nName: launch-testing\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[pytest11]\nlaunch_testing = launch_testing\n")
    return folder


def hide(package, folder, text=""):
    (folder / package).mkdir()
    (folder / package / "__init__.py").write_text(text)


def sourced(folder, *words, program=(sys.executable,), **options):
    """Exit code, output and errors of a program in a shell whose PYTHONPATH is the folder."""
    # xdist's variables would make a pytest of our own a worker
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    variables = inherited | {"PYTHONPATH": str(folder)}
    done = subprocess.run([*program, *words], env=variables, capture_output=True, text=True, **options)
    return done.returncode, done.stdout, done.stderr


def line(package, folder):
    names = f"{package} is loaded from {folder}, which PYTHONPATH names, not from {sys.prefix}"
    return f"error: {names}; unset PYTHONPATH\n"


@pytest.mark.parametrize(
    ("package", "text"),
    [
        ("pinocchio", "from .built_for_another_python import *\n"),
        ("numpy", "from .built_for_another_python import *\n"),  # loaded before the command is there
        ("yaml", "raise ImportError('undefined symbol')\n"),
        ("scipy", "__version__ = '0.1'\n"),  # another version
    ],
)
def test_a_command_and_a_stage_name_a_package_that_is_hidden_and_its_folder(ros, tmp_path, package, text):
    hide(package, ros, text)
    urdf = ("-m", "structlearn.command", "excite", "--urdf", str(tmp_path / "arm.urdf"))
    assert sourced(ros, *urdf) == (1, "", line(package, ros))
    assert sourced(ros, "-c", STAGE, cwd=tmp_path) == (1, "", line(package, ros))


def test_other_packages_and_our_own_sources_on_the_path_are_no_error(ros, root, tmp_path):
    hide("structlearn", tmp_path)
    for folder in (ros, root / "src", f"{ros}{os.pathsep}{root / 'src'}", ros / "not there", ""):
        assert sourced(folder, "-c", STAGE, cwd=tmp_path / "ros") == (0, "done\n", "")


def test_the_first_folder_counts_and_folders_of_the_environment_do_not(ros, tmp_path, monkeypatch):
    first = tmp_path / "first"
    first.mkdir()
    hide("numpy", first)
    hide("numpy", ros)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([sys.prefix, "", str(first), str(ros)]))
    assert shadowing.shadowed() == {"numpy": str(first)}
    with pytest.raises(InputError, match=f"numpy is loaded from {first}, which PYTHONPATH names"):
        shadowing.require_own_packages()
    monkeypatch.setenv("PYTHONPATH", sys.prefix)
    assert shadowing.shadowed() == {}


def test_a_library_user_is_told_of_the_failed_import_alone(ros):
    """A ROS node needs PYTHONPATH: what it hides matters only where it fails; other errors are its own."""
    hide("pinocchio", ros, "from .built_for_another_python import *\n")
    assert sourced(ros, "-c", "import structlearn.feedback, rclpy; print('spins')") == (0, "spins\n", "")
    found = sourced(ros, "-c", "import structlearn, pinocchio")
    assert found == (1, "", line("pinocchio", ros))
    for other in ("import not_there", "1 / 0"):
        code, said, errors = sourced(ros, "-c", f"import structlearn; {other}")
        assert (code, said) == (1, "")
        assert errors.startswith("Traceback")


def test_pytest_loads_the_plugins_that_it_names_and_no_hidden_package(ros, root):
    pytest_ = ("-m", "pytest", "-n", "0", "--collect-only", "tests/test_metrics.py")
    code, said, errors = sourced(ros, *pytest_, cwd=root)
    assert (code, errors) == (0, "")
    assert "test_metrics.py" in said
    hide("pinocchio", ros)
    assert sourced(ros, *pytest_, cwd=root) == (1, "", line("pinocchio", ros))


def test_make_runs_without_the_callers_python(ros, root, tmp_path):
    """Whatever a recipe is: here one of another makefile that includes the project's."""
    (tmp_path / "Makefile").write_text(
        f'include {root}/Makefile\nshow:\n\t@echo "$${{PYTHONPATH-unset}} $${{PYTHONHOME-unset}}"\n'
    )
    make = {"program": ("env", "PYTHONHOME=/usr", "make", "--no-print-directory"), "cwd": root}
    assert sourced(ros, "-f", str(tmp_path / "Makefile"), "show", **make)[:2] == (0, "unset unset\n")
