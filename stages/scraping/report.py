"""The report of the scraping testbed: three pages with their figures, tables and findings."""

from structlearn.core.stage import run, stage_parameters
from structlearn.reporting.claims import quoted_claims
from structlearn.reporting.publishing import publish_report
from structlearn.testbeds.scraping.files import ScrapingFiles
from structlearn.testbeds.scraping.page.findings import findings
from structlearn.testbeds.scraping.page.page import PARAMETERS, drawings, pages, published
from structlearn.testbeds.scraping.page.results import read_results
from structlearn.testbeds.scraping.page.tables import tables


def main() -> None:
    models = {key: model for page in PARAMETERS.values() for key, model in page.items()}
    parameters = {key: stage_parameters(key, model) for key, model in models.items()}
    results, printed = read_results(ScrapingFiles(), parameters), published()
    find, shown = findings(results), tables(results, printed)
    documents = pages(results, find, shown, printed)
    publish_report("reports/scraping", documents, drawings(results), shown, find, recorded=quoted_claims())


if __name__ == "__main__":
    run(main)
