"""Front page: findings as a forest plot and tables, from the claims judged by the reports."""

from pathlib import Path

from dissertation.evidence.claims import QUOTED
from dissertation.evidence.forest_figures import forest_figure
from dissertation.evidence.front import (
    findings_table,
    forest_strips,
    read_claims_of,
    read_front_page,
    render_front,
)
from structlearn.core.artefacts import publish
from structlearn.core.stage import run
from structlearn.reporting.document import Panel, Provenance, source_commit
from structlearn.reporting.figure_style import save

REPORTS = Path("reports")


def main() -> None:
    page = read_front_page(Path(__file__).with_suffix(".yaml"))
    claims = {
        name: read_claims_of(name, QUOTED if name == "recorded" else REPORTS / name / "tables")
        for name in page.reports
    }
    tasks = {
        path.parent.name: path.relative_to(REPORTS).as_posix()
        for path in sorted(REPORTS.glob("tasks/*/index.html"))
    }
    made = Provenance(source_commit(), command="dvc repro report")
    with publish(REPORTS / "figures") as folder:
        folder.mkdir()
        drawn = [
            save(one, folder / f"forest-{number}")
            for number, one in enumerate(forest_figure(forest_strips(page, claims)), 1)
        ]
    forest = [Panel(f"figures/{path.name}", *size) for path, size in drawn]
    with publish(REPORTS / "index.html") as path:
        path.write_text(render_front(page, claims, tasks, forest, made), encoding="utf-8")
    with publish(REPORTS / "findings.md") as path:
        path.write_text(findings_table(page, claims), encoding="utf-8")


if __name__ == "__main__":
    run(main)
