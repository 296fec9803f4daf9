import ast
import functools
import importlib
import operator
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import get_args

import pytest
from committed import read_yaml
from pydantic import Field, ValidationError

from structlearn.core.errors import InputError
from structlearn.core.params import Parameters, Population, read_parameters
from structlearn.tasks.motion.excite import ExciteParameters


class FilterParameters(Parameters):
    cutoff_hz: float = Field(gt=0)


class SegmentParameters(Parameters):
    extension_s: float = Field(gt=0)
    count: int = Field(default=3, ge=1)
    filter: FilterParameters = FilterParameters(cutoff_hz=5.0)


BOMB = "a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1]\n"
for name, before in zip("bcdefghij", "abcdefghi", strict=True):
    BOMB += f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]\n"
BOMB += "segment: {extension_s: *j}"  # 9^10 numbers, were it written out


def read(tmp_path, text):
    path = tmp_path / "params.yaml"
    path.write_text(text)
    return read_parameters(path, "segment", SegmentParameters)


def test_values_are_read_at_a_dotted_key_and_frozen(tmp_path):
    found = read(tmp_path, "other: {unknown: 1}\nsegment:\n  extension_s: 0.5\n  filter: {cutoff_hz: 2}\n")
    assert found == SegmentParameters(extension_s=0.5, filter=FilterParameters(cutoff_hz=2.0))
    with pytest.raises(ValidationError, match="frozen"):
        found.extension_s = 1.0
    path = tmp_path / "params.yaml"
    assert read_parameters(path, "segment.filter", FilterParameters).cutoff_hz == 2.0
    for key in ("segment.filters", "other.filter", "segment.extension_s.filter"):
        with pytest.raises(InputError, match=f"key '{key}' is missing"):
            read_parameters(path, key, FilterParameters)
    changed = f"segment: {{extension_s: 0.25}} # {'- ' * 20_000}\n"  # however long its lines
    assert read(tmp_path, changed).extension_s == 0.25
    with pytest.raises(InputError, match=r"nowhere\.yaml: no such parameter file"):
        read_parameters(tmp_path / "nowhere.yaml", "segment", SegmentParameters)


VALUE, YAML = "segment.extension_s: ", "not a YAML file: "
DEEP = "nested too deeply"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("segment: {extension_s: 1, extent: 2}", "segment.extent: unknown parameter$"),
        ("segment: {extension_s: 1, filter: {order: 2}}", ".*segment.filter.order: unknown parameter$"),
        ("segment: {extension_s: .nan}", VALUE + r"Input should be a finite number \(got nan\)$"),
        ("segment: {extension_s: yes}", VALUE + r".*true or false.* \(got True\)"),
        (BOMB, VALUE + r".*valid number.* \(got \[{6}.{,600}$"),
        ("segment: {}", VALUE + "Field required"),
        ("segment: {extension_s: -1, count: 0}", VALUE + ".*; segment.count: .*"),
        ("segment:", r"segment: .*\(got None\)"),
        *((text, "key 'segment' is missing$") for text in ("other: {}", "", "- a list")),
        ("segment: {extension_s: 2026-13-45}", YAML + "month must be in 1..12"),
        (f"segment: {{extension_s: 1, count: {'9' * 6000}}}", YAML + "Exceeds the limit"),
        ("segment: {extension_s: !!bool x}", YAML),
        ("segment: !!python/object/apply:os.getcwd []", YAML),
        ("segment: " + "[" * 200_000 + "]" * 200_000, YAML + DEEP),
        ("segment: {a: " + "[\n" * 200_000 + "]" * 200_000, YAML + DEEP),
        ("- " * 200_000, YAML + DEEP),
        ("a:\r" + "- " * 200_000, YAML + DEEP),
        ("segment: {extension_s: 1\nother: [", YAML + ".*line 2"),
        (b"PAR1\x80\x81\xff", YAML),
        ("segment: {}\nsegment: {}\n", r"key 'segment' is defined twice \(line 2\)$"),
        ("segment: {filter: {cutoff_hz: 1, cutoff_hz: 2}}", r"key 'cutoff_hz' is defined twice \(line 1\)$"),
    ],
)
def test_a_fault_is_named_with_its_file_and_dotted_key(tmp_path, text, expected):
    path = tmp_path / "params.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as error:
        read_parameters(path, "segment", SegmentParameters)
    assert re.match(f"{re.escape(str(path))}: {expected}", str(error.value), re.DOTALL)


FILES = (
    "params.yaml",
    "src/structlearn/tasks/stages/params.yaml",
)


def read_by(script: Path) -> Iterator[tuple[str, type[Parameters]]]:
    """Keys that a stage reads with their models: from calls of `stage_parameters`, and mappings for them."""
    tree = ast.parse(script.read_text())
    origins = {
        name.asname or name.name: (node.module, name.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for name in node.names
    }
    for node in ast.walk(tree):
        pairs = []
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "stage_parameters":
            pairs = [node.args[:2]]
        elif isinstance(node, ast.Dict):
            pairs = [*zip(node.keys, node.values, strict=True)]
        for key, model in pairs:
            module, _, name = ast.unparse(model).rpartition(".")
            if isinstance(key, ast.Constant) and name.endswith(("Parameters", "Population", "Limits")):
                home, known = origins[module or name]
                home, known = (f"{home}.{known}", name) if module else (home, known)
                yield key.value, getattr(importlib.import_module(home), known)


@pytest.fixture(scope="module")
def models(root):
    found: dict[str, set[type[Parameters]]] = {}
    for script in sorted((root / "stages").rglob("*.py")):
        for key, model in read_by(script):
            found.setdefault(key, set()).add(model)
    return found | {"excite": {ExciteParameters}}  # of a command


def nested_models(model: type[Parameters]) -> set[type[Parameters]]:
    """A model and those of its fields, of their fields, and so on."""

    def within(annotation: object) -> Iterator[type[Parameters]]:
        if isinstance(annotation, type) and issubclass(annotation, Parameters):
            yield from nested_models(annotation)
        for argument in get_args(annotation):
            yield from within(argument)

    return {model}.union(*(within(field.annotation) for field in model.model_fields.values()))


def test_every_key_is_read_by_a_stage_and_every_key_read_is_there(root, models):
    written = {key: root / file for file in FILES for key in read_yaml(root / file)}
    assert {key.split(".")[0] for key in models} == set(written) - {"defaults"}
    for key, its in models.items():
        for model in its:
            read_parameters(written[key.split(".")[0]], key, model)


def test_a_stage_depends_on_the_parameters_that_it_reads_and_on_no_others(root):
    """Key by key, or on the whole file."""
    for stage in read_yaml(root / "dvc.yaml")["stages"].values():
        declared = set(stage.get("params", []))
        if "params.yaml" in stage["deps"]:
            assert not declared
            continue
        read = {key for key, _ in read_by(root / stage["cmd"].split()[1])}
        assert {key for key in declared if key not in read} <= {f"{one}.{part}" for one, part in PARTS}
        assert {key for key in read if key not in declared} <= {one for one, _ in PARTS}


PARTS = [("coupling_dataset", "sensors"), ("coupling_dataset", "settings_deg")]
PARTS += [("refine", "setting_deg"), ("refine", "settings_deg"), ("train_dynamics", "learning")]
PARTS += [("touch_dataset", "rate_hz")]
"""Of a key whose other values a stage reads but does not use."""


MAY_BE_LEFT_OUT = {"PrimitiveParameters", "BoundParameters", "JointPose"}
"""Of a primitive a name is enough: the rest is found from the data. Joints are renamed where names differ."""


def test_no_parameter_has_a_second_value_in_the_code(models):
    every = set().union(*(nested_models(model) for its in models.values() for model in its))
    defaults = [
        f"{model.__name__}.{name}"
        for model in every
        for name, field in model.model_fields.items()
        if not field.is_required() and model.__name__ not in MAY_BE_LEFT_OUT
    ]
    assert len(every) > 70
    assert defaults == []


EXPLAINED = r"as(?: of)? `|by primitive|in order of time|and the joint"
"""In the comment of a group: it says what all its values are, or where they are explained."""


@pytest.mark.parametrize("file", FILES)
def test_every_value_has_a_line_of_its_own_with_a_comment(root, file):
    """Beside or above it; or the comment of its group says what all are, or where they are explained."""
    lines = (root / file).read_text().splitlines()
    assert max(map(len, lines)) <= 100
    groups: list[tuple[int, str]] = []  # the keys above, with their indentation
    bare = []
    for before, line in pairwise(["", *lines]):
        if key := re.match(r"((?: |- )*)[\w.]+:( +[^ #].*?)?(  # .*)?$", line):
            groups = [group for group in groups if group[0] < len(key[1])]
            above = before if before.lstrip().startswith("#") else ""
            groups.append((len(key[1]), f"{above}{key[3] or ''}"))
            if key[2] and not groups[-1][1] and not any(re.search(EXPLAINED, its) for _, its in groups[:-1]):
                bare.append(line)
        else:
            assert re.match(r" *(#|- [^{:]*$|$)", line), line
    assert bare == []


def test_experiments_that_the_documentation_shows_change_keys_that_are_there(root):
    shown = re.findall(r"-S ([\w.]+)=", (root / "docs/parameters.md").read_text())
    parameters = read_yaml(root / "params.yaml")
    assert shown
    for key in shown:
        assert functools.reduce(operator.getitem, key.split("."), parameters) is not None


def test_nobody_is_told_to_let_dvc_write_the_parameters_anew(root):
    found = [*(root / "docs").glob("*.md"), *(root / "src").rglob("*.jinja")]
    for path in (root / "README.md", root / "params.yaml", *found):
        assert not re.search(r"dvc exp run(?! --temp)", path.read_text()), path


@pytest.mark.parametrize(
    ("seeds", "words"),
    [
        ({"tuning": [1, 2], "test": [2, 3]}, r"seeds \[2\] are in `tuning` and in `test`"),
        ({"tuning": [1], "test": [2, 2]}, "is defined twice"),
        ({"tuning": [], "test": [2]}, "at least 1 item"),
    ],
)
def test_tuning_and_test_seeds_are_apart(seeds, words, models):
    assert Population(tuning=[1, 2], test=[11, 12]).shown == 1
    with pytest.raises(ValidationError, match=words):
        Population(**seeds)
    keys = {key for key, its in models.items() if any(issubclass(one, Population) for one in its)}
    assert keys == {"scraping_people", "obstacle_people", "dynamics_robots", "servo_people"}
