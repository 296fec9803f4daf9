"""Every link of the pages and of the documentation leads to a file, and to an anchor in it."""

import re
from functools import cache
from pathlib import Path

import pytest
from committed import ROOT

from structlearn.reporting.document import anchor

REPORTS = ROOT / "reports"
PAGES = sorted(REPORTS.rglob("*.html"))
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
ELSEWHERE = re.compile(r"[a-z]+:|//")
NOT_IN_GIT = (".rrd",)  # 3-D recordings, which the pipeline makes
MADE_BY_MAKE_DOCS = {"docs/dissertation.md", "docs/notebook.md", "docs/api/index.md"}


@cache
def anchors(path: Path) -> frozenset[str]:
    """What a link into a page or document can name."""
    text = path.read_text()
    if path.suffix == ".md":
        return frozenset(anchor(heading) for heading in re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE))
    return frozenset(re.findall(r'\bid="([^"]+)"', text))


def links(path: Path) -> set[str]:
    """Links of a page or document that stay in the project."""
    pattern = r"\]\(([^)\s]+)\)" if path.suffix == ".md" else r'(?:href|src)="([^"]*)"'
    return {link for link in re.findall(pattern, path.read_text()) if link and not ELSEWHERE.match(link)}


def broken(path: Path) -> list[str]:
    """Links whose file or anchor is missing."""
    missing = []
    for link in sorted(links(path)):
        name, _, place = link.partition("#")
        target = (path.parent / name).resolve() if name else path
        if name.endswith(NOT_IN_GIT) or target.as_posix().removeprefix(f"{ROOT}/") in MADE_BY_MAKE_DOCS:
            continue
        if not target.exists() or (place and place not in anchors(target)):
            missing.append(link)
    return missing


@pytest.mark.parametrize("path", [*PAGES, *DOCUMENTS], ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_link_leads_somewhere(path):
    assert broken(path) == []


def test_a_missing_file_or_anchor_is_found(tmp_path):
    (tmp_path / "other.html").write_text('<details><table><tr id="row"></tr></table></details>')
    page = tmp_path / "page.html"
    good = '<a href="#own" id="own"></a><a href="other.html#row"></a><a href="https://doi.org/x"></a>'
    page.write_text(f'{good}<a href="gone.html"></a><a href="other.html#gone"></a><img src="gone.svg">')
    assert broken(page) == ["gone.html", "gone.svg", "other.html#gone"]
