"""From recordings of demonstrations to a checked skill for a robot, in a project folder of your own.

    structlearn inspect ~/bags              contents of recordings, and whether they are suitable
    structlearn new pour --from ~/bags      a folder pour/ with an entry proposed from recordings
    cd pour && structlearn run              cuts, primitives, feedback, skill: reports/tasks/pour/index.html
    structlearn add wipe --from ~/wipes     a further entry in the project's structlearn.yaml
    structlearn check pour                  can the robot follow the skill? (`robot:` in the entry)
    structlearn view pour                   the recordings in 3-D
    structlearn export pour                 the demonstrations as a LeRobotDataset
    structlearn export pour --cpp include   the skill's controller as a C++ header
    structlearn excite --urdf arm.urdf      an excitation trajectory for identifying an arm
    structlearn examples                    where the example scripts are

Recordings are ROS bags (.mcap, .db3, .bag), tables of poses (.csv, .parquet) or LeRobotDatasets. A project
has its entries in `structlearn.yaml`, its pipeline in `dvc.yaml`, and its own git and DVC repositories. An
entry overrides `structlearn defaults`, for example

    movement:
      pour:
        source: ~/bags                      # a recording per demonstration, or several repeats in each:
        repeats: auto
        topics: {pose: /gripper/pose}
        segment: {primitives: [reach, pour, retreat]}
        robot: {urdf: ~/arm.urdf, tip: tool0}
"""

import argparse
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from importlib.metadata import files as files_of
from pathlib import Path

import yaml

from structlearn import __version__
from structlearn.core.artefacts import publish
from structlearn.core.errors import InputError
from structlearn.core.params import home_path
from structlearn.core.stage import run
from structlearn.tasks import project
from structlearn.tasks.kinds import KINDS
from structlearn.tasks.task_files import ABSENT, NAME_RULE, TaskFiles, is_name

HEADER = """\
# Tasks of this project by kind of data. An entry overrides the defaults of the package, which
# `structlearn defaults` prints. `structlearn run` runs all tasks, `structlearn run NAME` one.
"""

EXAMPLES = "share/structlearn/examples"  # in an installation, see pyproject.toml


def main(words: list[str] | None = None) -> None:
    """Run one of the commands; on invalid input, print one line and exit with code 1."""
    given = _arguments(words)
    sys.path.insert(0, "")  # modules that entries name may be in the project
    run(lambda: given.do(given), stage=False)


def new(given: argparse.Namespace) -> None:
    """Make a project folder from recordings."""
    folder, name = Path(given.name), Path(given.name).name
    if not is_name(name):
        raise InputError(f"{name!r}: {NAME_RULE}")
    if folder.exists() and any(folder.iterdir()):
        raise InputError(f"{folder}: already exists and is not empty")
    if entries := project.entries_above(folder):
        raise InputError(
            f"{folder}: is inside of a project; add an entry to {entries} by `structlearn add`, or choose "
            "another place"
        )
    entry = _entry(given, name)
    with publish(folder) as target:
        target.mkdir()
        text = "\n".join(["", f"{given.kind}:", *entry, ""])
        project.write_project(target, HEADER + text, project.packaged_pipeline())
    _begin(folder)
    written, place = (shlex.quote(str(path)) for path in (folder / project.ENTRIES, folder))
    print(f"{folder}: look at {written}, then: cd {place} && structlearn run")


def add(given: argparse.Namespace) -> None:
    """Add a task to the project's entries, proposed from recordings."""
    from structlearn.tasks.task_entry import add_entry

    add_entry(given.kind, given.name, lambda: _entry(given, given.name))
    print(f"{project.ENTRIES}: look at {given.kind}.{given.name}, then: structlearn run {given.name}")


def _entry(given: argparse.Namespace, name: str) -> list[str]:
    """YAML lines of the entry below its kind; movements include what the recordings suggest.

    Paths in it are absolute, since it may be read in another folder.
    """
    source, urdf = _absolute(given.source), given.urdf and _absolute(given.urdf)
    if not Path(source).exists():
        raise InputError(f"{given.source}: no such file or folder")
    if urdf and given.kind not in ("movement", "motion"):
        raise InputError(f"--urdf: tasks of kind {given.kind} have no robot")
    if given.kind == "movement":
        return _proposed(source, urdf, name)
    values = {"source": source}
    if given.kind == "motion":
        _check_motion(source, urdf)
        values["urdf"] = urdf
    text = yaml.safe_dump({name: values}, sort_keys=False, allow_unicode=True, width=float("inf"))
    return [f"  {line}" for line in text.splitlines()]


def _absolute(path: str) -> str:
    """Absolute path of a file or folder that exists; others, such as files of `pybullet_data`, as written."""
    return str(home_path(path).resolve()) if home_path(path).exists() else path


def _proposed(source: str, urdf: str | None, name: str) -> list[str]:
    from structlearn.tasks.inspection.recordings_report import as_yaml, find_out

    report = find_out(source, urdf)
    if report.proposal is None:
        raise InputError(f"{source}: {report.obstacle}")
    for answer in report.answers:
        print(f"{answer.verdict:12} {answer.question} {answer.number}")
    return as_yaml(report.proposal._replace(name=name))


def _check_motion(source: str, urdf: str | None) -> None:
    """Raise InputError if there is no robot, or joint states that dynamics cannot be learned from."""
    from structlearn.readers.joint_log import unusable_efforts
    from structlearn.readers.urdf_file import urdf_path
    from structlearn.tasks.inspection.source_survey import look_at

    if not urdf:
        raise InputError("an arm is identified with its URDF: give --urdf FILE")
    urdf_path(urdf)
    for file in look_at(source).files:  # a hand beside the arm may measure no efforts
        reasons = [unusable_efforts(joints) for seen in file.topics.values() for joints in seen.joints]
        if reasons and all(reasons):
            raise InputError(f"{source}: {file.name}: the arm cannot be identified: {reasons[0]}")


def _begin(folder: Path) -> None:
    """Put a project under git (unless it is inside a repository) and DVC."""
    inside = _quietly(["git", "-C", str(folder), "rev-parse", "--is-inside-work-tree"])
    if not inside and not _quietly(["git", "-C", str(folder), "init"]):
        _dvc(folder, "init", "--quiet", "--no-scm")
    else:
        top = (folder / ".git").exists()
        _dvc(folder, "init", "--quiet", *([] if top else ["--subdir"]))
    _dvc(folder, "config", "core.analytics", "false")


def make(given: argparse.Namespace) -> None:
    """Bring all tasks up to date, or one: from recordings to a page."""
    from structlearn.tasks.task_entry import targets

    stages = targets(given.task or "")
    if not stages:
        raise InputError(f"{project.ENTRIES}: has no task")
    _dvc(Path(), "repro", "--keep-going", *stages)
    names = dict.fromkeys(stage.rpartition("@")[2] for stage in stages)
    print(*(f"{TaskFiles(name).report}/index.html is up to date" for name in names), sep="\n")


def check(given: argparse.Namespace) -> None:
    """Check whether the robot of a task can follow its skill."""
    from structlearn.tasks.movement import check_results

    _require_movement(given.task)
    _dvc(Path(), "repro", "--quiet", f"check@{given.task}")
    if not check_results.main(TaskFiles(given.task)):
        sys.exit(1)


def view(given: argparse.Namespace) -> None:
    """Open the recordings of a task in 3-D."""
    from structlearn.tasks.task_entry import read_task

    folder = TaskFiles(given.task).report / "rerun"
    files = sorted(map(str, folder.glob("*.rrd")))
    if not files:
        read_task(given.task)
        raise InputError(f"{folder}: no recordings; make them first: structlearn run {given.task}")
    if not given.web and sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ):
        raise InputError(
            f"there is no display for {folder}; in a browser: structlearn view {given.task} --web"
        )
    web = ("--serve-web", "--bind", "127.0.0.1") if given.web else ()
    if given.web:
        print("http://localhost:9090/?url=rerun%2Bhttp%3A%2F%2Flocalhost%3A9876%2Fproxy")
    subprocess.run([_beside_python("rerun"), *web, *files], check=False)


def export(given: argparse.Namespace) -> None:
    """Write the demonstrations of a task as a LeRobotDataset (v3.0), or its skill as a C++ header."""
    if given.cpp:
        if unused := [name for name in ("fps", "words", "robot") if getattr(given, name) is not None]:
            raise InputError(f"--{unused[0]} is of a LeRobotDataset, not of a C++ header (--cpp)")
        return export_cpp(given)
    from structlearn.tasks.movement.lerobot_export import write_lerobot
    from structlearn.tasks.movement.parameters import MovementEntry

    files = TaskFiles(given.task)
    if not files.segments.exists():
        _require_movement(given.task)
        raise InputError(f"{files.segments}: does not exist; make it first: structlearn run {given.task}")
    target, entry = given.to or Path(given.task), files.entry(MovementEntry)
    if target.exists():
        raise InputError(f"{target}: already exists")
    words = given.words or entry.title or files.name
    runs, cuts = files.runs("demonstrations"), files.segmentation()
    count = write_lerobot(runs, cuts, target, words, entry.fit.smoothing_hz, given.fps, given.robot)
    print(f"{target}: LeRobotDataset of {count} episodes")


def export_cpp(given: argparse.Namespace) -> None:
    """Write a skill, of a task or a file, as a C++ header."""
    from structlearn.feedback.cpp_export import write_header

    file, name = Path(given.task), Path(given.task).stem
    if not file.is_file() and file.suffix != ".safetensors":
        file, name = TaskFiles(given.task).skill, given.task
        if not file.exists():
            _require_movement(name)
            if (absent := file.with_name(ABSENT)).exists():
                raise InputError(f"{name} has no skill: {absent.read_text(encoding='utf-8').strip()}")
            raise InputError(f"{file}: does not exist; make it first: structlearn run {name}")
    print(f"{write_header(file, name, given.cpp)}: controller in C++17 of {file}")


def _require_movement(task: str) -> None:
    """Raise InputError if there is no such task, or it is of another kind."""
    from structlearn.tasks.task_entry import read_task

    if (kind := read_task(task).kind) != "movement":
        raise InputError(f"{project.ENTRIES}: {kind}.{task}: is not a movement")


def examples(given: argparse.Namespace) -> None:
    """Print the folder of the example scripts."""
    installed = [file for file in files_of("structlearn") or () if EXAMPLES in file.as_posix()]
    clone = Path(project.__file__).parents[3] / "examples"
    print(Path(str(installed[0].locate())).resolve().parent if installed else clone)


def defaults(given: argparse.Namespace) -> None:
    """Print the keys of an entry with units and defaults."""
    print(project.DEFAULTS.read_text(encoding="utf-8"), end="")


def inspect(given: argparse.Namespace) -> None:
    """Show the contents of recordings and their suitability, and propose an entry."""
    from structlearn.tasks.inspection.recordings_report import inspect_source

    inspect_source(_absolute(given.source), given.urdf and _absolute(given.urdf), given.output)


def excite(given: argparse.Namespace) -> None:
    """Design an excitation trajectory for an arm, within the limits of its URDF."""
    from structlearn.tasks.motion.excite import design_trajectory

    design_trajectory(given.task, given.urdf, given.lock)


def _dvc(folder: Path, *words: str) -> None:
    """Run DVC with this environment's programs first on the path; exit with its code if it fails.

    Raises InputError: the folder is not writable.
    """
    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise InputError(f"{folder.resolve()}: cannot be written: {error.strerror}") from error
    if (folder / project.PIPELINE).exists():
        project.update_code(folder)
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    done = subprocess.run(
        [_beside_python("dvc"), *words], cwd=folder, env=os.environ | {"PATH": path}, check=False
    )
    if done.returncode:
        sys.exit(done.returncode)


def _beside_python(program: str) -> str:
    """Path of a program in this Python environment, or else on the system's path."""
    beside = Path(sys.executable).with_name(program)
    place = str(beside) if beside.exists() else shutil.which(program)
    if place is None:
        raise InputError(f"{program}: is not installed beside {sys.executable}")
    return place


def _quietly(words: Sequence[str]) -> bool:
    try:
        return subprocess.run(words, capture_output=True, check=False).returncode == 0
    except OSError:
        return False


def _arguments(words: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="structlearn", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--version", action="version", version=f"structlearn {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def command(name: str, do: Callable[[argparse.Namespace], None]) -> argparse.ArgumentParser:
        words = (do.__doc__ or "").rstrip(".")
        subparser = commands.add_parser(name, help=words[0].lower() + words[1:], description=words)
        subparser.set_defaults(do=do)
        return subparser

    def proposed(subparser: argparse.ArgumentParser) -> None:
        subparser.add_argument("--from", dest="source", required=True, help="recording, or folder of them")
        subparser.add_argument(
            "--kind", choices=KINDS, default="movement", help="kind of data (default: movement)"
        )
        subparser.add_argument("--urdf", help="the robot: to compute poses from joints, or to identify")

    subparser = command("new", new)
    subparser.add_argument("name", help="folder to make; its last part is the task's name")
    proposed(subparser)
    subparser = command("add", add)
    subparser.add_argument("name", help="name of the task")
    proposed(subparser)
    subparser = command("run", make)
    subparser.add_argument("task", nargs="?", help="default: all")
    subparser = command("check", check)
    subparser.add_argument("task")
    subparser = command("view", view)
    subparser.add_argument("task")
    subparser.add_argument("--web", action="store_true", help="serve them to a browser")
    subparser = command("export", export)
    subparser.add_argument("task", help="a task; with --cpp, also a skill file")
    subparser.add_argument("--format", choices=["lerobot"], default="lerobot")
    place = subparser.add_mutually_exclusive_group()
    place.add_argument("--cpp", type=Path, metavar="FOLDER", help="where to write the skill's C++ header")
    place.add_argument("--to", type=Path, help="folder to make (default: the task's name)")
    subparser.add_argument("--fps", type=int, help="frames per second (default: those of the task's clock)")
    subparser.add_argument("--words", help="description of the task (default: the task's title or name)")
    subparser.add_argument("--robot", help="name of the robot")
    subparser = command("excite", excite)
    robot = subparser.add_mutually_exclusive_group(required=True)
    robot.add_argument("--task", help="a task whose entry names the robot")
    robot.add_argument("--urdf", help="the robot")
    subparser.add_argument("--lock", nargs="*", default=(), help="joints that do not move, e.g. of a gripper")
    command("examples", examples)
    command("defaults", defaults)
    subparser = command("inspect", inspect)
    subparser.add_argument("source", help="a file, a bag, or a folder of them")
    subparser.add_argument("--urdf", help="the robot, to compute poses from joints")
    subparser.add_argument("--output", type=Path, help="file for the proposed entry")
    return parser.parse_args(words)


if __name__ == "__main__":
    main()
