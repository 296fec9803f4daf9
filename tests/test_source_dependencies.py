from pathlib import Path

import pytest
import yaml

from structlearn.source_dependencies import PIPELINES, source_dependencies


@pytest.mark.parametrize("pipeline", PIPELINES)
def test_every_stage_lists_the_modules_that_it_runs(root, pipeline):
    stages = yaml.safe_load((root / pipeline).read_text())["stages"]
    for name, stage in stages.items():
        declared = [dep for dep in stage["deps"] if dep.endswith(".py")]
        expected = source_dependencies(Path(stage["cmd"].split()[1]), root)
        assert declared == expected, f"{pipeline}: {name}: run `make deps`"


def test_every_data_dependency_is_the_output_of_some_stage(root):
    stages = [
        stage
        for pipeline in PIPELINES
        for stage in yaml.safe_load((root / pipeline).read_text())["stages"].values()
    ]
    outputs = set()
    for stage in stages:
        for out in [*stage.get("outs", []), *stage.get("metrics", [])]:
            outputs.add(out if isinstance(out, str) else next(iter(out)))
    for stage in stages:
        data = {dep for dep in stage["deps"] if not dep.startswith(("src/", "stages/"))}
        assert data <= outputs


def test_imports_are_followed_through_packages_and_functions(tmp_path):
    package = tmp_path / "src" / "house"
    (package / "attic").mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "attic" / "__init__.py").write_text("from house.cellar import coal\n")
    (package / "attic" / "trunk.py").write_text("import numpy\n")
    (package / "cellar.py").write_text("coal = 1\n")
    (package / "garden.py").write_text("")
    (tmp_path / "main.py").write_text("def main():\n    from house.attic import trunk\n")
    assert source_dependencies(Path("main.py"), tmp_path) == [
        "main.py",
        "src/house/__init__.py",
        "src/house/attic/__init__.py",
        "src/house/attic/trunk.py",
        "src/house/cellar.py",
    ]
