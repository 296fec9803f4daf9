"""The documentation: its links lead somewhere, and the index finds what the dissertation numbers."""

import importlib.util
import json
import re
import runpy
import subprocess
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest
import yaml
from committed import ROOT, read_yaml

from structlearn import __version__

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
MADE = {"docs/dissertation.md", "docs/notebook.md", "docs/api/index.md"}
"""By `docs/hooks.py`, when the site is built."""

TOLD = (
    "*.md",
    "src/**/*.py",
    "src/**/*.jinja",
    "stages/**/*.py",
    "examples/**",
    "reports/**/*.html",
    "*.yaml",
)
"""Files that tell people what to run."""


@pytest.fixture(scope="module")
def hooks():
    spec = importlib.util.spec_from_file_location("hooks", ROOT / "docs/hooks.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_to_files(page):
    for link in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text()):
        target = (page.parent / link).resolve()
        assert "://" in link or target.exists() or target.relative_to(ROOT).as_posix() in MADE, link


def test_nobody_is_told_to_run_a_stage_without_those_before_it():
    """A stage alone (`--single-item`) goes by lists of code that may be old, and may wrongly count as new."""
    told = subprocess.run(
        ["git", "ls-files", "--", *TOLD], cwd=ROOT, capture_output=True, text=True, check=True
    )
    files = told.stdout.split()
    assert {Path(file).suffix for file in files} >= {".md", ".py", ".jinja", ".html", ".yaml"}
    alone = re.compile(r"dvc repro\b[^\n`<]*?\s(?:-\w*s\b|--single-item)")
    assert [file for file in files if alone.search((ROOT / file).read_text(encoding="utf-8"))] == []


def test_every_page_stands_in_the_navigation():
    navigation = yaml.dump(read_yaml(ROOT / "mkdocs.yml")["nav"])
    assert all(page.name in navigation for page in (ROOT / "docs").glob("*.md"))


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text().split()) <= 1000


def test_the_timings_of_the_readme_are_those_measured_and_no_faster_peer_is_left_out():
    made = runpy.run_path(str(ROOT / "benchmarks/readme_table.py"))
    table = pd.read_csv(made["TABLE"])
    assert (
        f"<!-- timings -->\n{made['markdown'](table)}<!-- end of timings -->"
        in (ROOT / "README.md").read_text()
    )
    peers = made["fastest_peers"](table)
    assert set(peers.index[peers["ratio"] < 1.0]) <= set(made["LABELS"])
    assert made["markdown"](table).count("**") == 2 * (peers.loc[list(made["LABELS"]), "ratio"] < 1.0).sum()


def test_one_version_is_named_everywhere():
    assert read_yaml(ROOT / "CITATION.cff")["version"] == __version__
    assert f"\n## {__version__}" in (ROOT / "CHANGELOG.md").read_text()


def test_the_index_finds_what_is_numbered(hooks):
    citations = hooks.citations()
    found = {(one.kind, one.number) for one in citations}
    wanted = {
        "table": ["III.1", "III.2", *(f"IV.{one}" for one in range(1, 6))],
        "figure": [f"II.{one}" for one in range(3, 7)] + ["III.2"]
        + [f"IV.{one}" for one in (14, *range(16, 21))],
        "eq": [*(f"II.{one}" for one in (2, 3, 4, 5, 13, 15, 23)), *(f"III.{one}" for one in range(3, 17))]
        + [f"IV.{one}" for one in (1, 3, 4, 12, *range(16, 32), 33, 34)],
        "section": ["II.4.1.3", "III.4.1.2", "IV.5", "IV.7", "IV.9.1.3", "V.2"],
    }  # fmt: skip
    assert {(kind, number) for kind, its in wanted.items() for number in its} <= found
    lines = {path: (ROOT / path).read_text().splitlines() for path in {one.path for one in citations}}
    for one in citations:  # its place is a line of the source
        line = lines[one.path][one.line - 1]
        assert one.line == 1 or one.name in line or line.startswith("@") or "def" in line or "#" in line


def test_the_index_has_every_figure_and_table_and_leads_to_lines(hooks):
    citations = hooks.citations()
    index, sources = hooks.dissertation_page(citations), hooks.source_pages(citations)
    for entry in read_yaml(ROOT / "stages/report.yaml")["index"]:
        kind, number = entry["what"].split()
        rows = index.partition(f"## {hooks.KINDS[kind]}\n")[2].partition("\n## ")[0]
        assert f"\n| {number} | {entry['shows']} | " in rows, entry["what"]
    links = set(re.findall(r"\]\(([^)#]+)#__codelineno-0-(\d+)\)", index))
    assert len(links) > 200
    for page, line in links:  # the block of code begins at the fourth line
        assert len(sources[page].splitlines()) - 3 > int(line)
    assert {page for page, _ in links} == set(sources)
    for page in re.findall(r'href="\.\./(reports/[^"#]+)', index):
        assert (ROOT / page).exists(), page


def test_the_search_needs_no_network_and_knows_no_code(hooks):
    (script,) = read_yaml(ROOT / "mkdocs.yml")["extra"]["polyfills"]
    assert "iframe-worker" in script  # what the theme would fetch otherwise
    assert "IFrameWorker" in (ROOT / "docs" / script).read_text()

    def searched(name):
        page = SimpleNamespace(meta={}, file=SimpleNamespace(src_uri=name))
        hooks.on_page_markdown("", page, None, None)
        return page.meta.get("search", {})

    assert searched("source/structlearn.core.frames.py.md") == {"exclude": True}
    assert searched("robot.md")["boost"] > 1000.0  # of a heading
    assert searched("api/core.md") == searched("dissertation.md") == {}
    shown = '<details class="mkdocstrings-source"><summary>Source'
    assert "data-search-exclude>" in hooks.on_page_content(shown, None, None, None)


def cells_of(script):
    """Kind and text of the cells of a notebook's script: texts and magics are comments in it."""
    for cell in re.split(r"^# %%", script, flags=re.MULTILINE)[1:]:
        head, _, body = cell.partition("\n")
        text = "[markdown]" in head
        lines = body.strip("\n").splitlines()
        plain = [re.sub(r"^# ?", "", line) if text or line.startswith("# !") else line for line in lines]
        yield "markdown" if text else "code", "\n".join(plain)


def test_the_notebook_is_that_of_its_script_was_run_and_names_no_machine():
    cells = json.loads((ROOT / "examples/pick.ipynb").read_text())["cells"]
    assert [(cell["cell_type"], "".join(cell["source"])) for cell in cells] == list(
        cells_of((ROOT / "examples/pick.py").read_text())
    )
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    outputs = [output for cell in code for output in cell["outputs"]]
    assert {output["output_type"] for output in outputs} == {"stream", "display_data"}
    said = "".join("".join(output.get("text", "")) for output in outputs)
    assert "0 of 33 runs fail" in said
    assert not re.search(r"(?<![\w.])/(?!gripper|joint_states|wrist)\w+/|\x1b|Warning|Traceback", said)


def test_make_alone_lists_every_target():
    phony = re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)[1].split()
    told = subprocess.run(
        ["make", "--no-print-directory"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    listed = {target for line in told.stdout.splitlines() for target in line[:18].split()}
    assert listed == set(phony) - {"help"}
