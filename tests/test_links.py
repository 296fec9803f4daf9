"""Every link of the pages and of the documentation leads to a file, and to an anchor in it."""

import pytest
from committed import ROOT, read_yaml
from page_links import broken

PAGES = sorted((ROOT / "reports").rglob("*.html"))
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
BY_MAKE_DOCS = tuple(
    ROOT / name for name in ("docs/dissertation.md", "docs/notebook.md", "docs/api/index.md")
)
BY_MAKE_REPRO = tuple(
    ROOT / out
    for stage in read_yaml(ROOT / "dvc.yaml")["stages"].values()
    for out in stage.get("outs", [])
    if isinstance(out, str)  # not kept in git
)


@pytest.mark.parametrize("path", [*PAGES, *DOCUMENTS], ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_link_leads_somewhere(path):
    """Once `make repro` has run, which makes the 3-D recordings of the testbeds, not those of public sets."""
    assert broken(path, BY_MAKE_DOCS + BY_MAKE_REPRO) == []


def test_a_missing_file_or_anchor_is_found(tmp_path):
    (tmp_path / "other.html").write_text('<details><table><tr id="row"></tr></table></details>')
    page = tmp_path / "page.html"
    good = '<a href="#own" id="own"></a><a href="other.html#row"></a><a href="https://doi.org/x"></a>'
    page.write_text(f'{good}<a href="gone.html"></a><a href="other.html#gone"></a><img src="gone.svg">')
    assert broken(page) == ["gone.html", "gone.svg", "other.html#gone"]
