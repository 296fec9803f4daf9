"""Verdicts on a page's claims from evidence alone, and a page's sentences without its figures being drawn."""

from collections.abc import Mapping
from importlib.resources import files

from structlearn.reporting.claims import Evidence, Found, combined, read_claims
from structlearn.reporting.document import Panel


def verdicts(package: str, found: Mapping[str, Found]) -> dict[str, str]:
    """By the name of the evidence; every claim rests on its own."""
    words = {}
    for claim in read_claims(files(package) / "claims.yaml"):
        cases = found[claim.evidence]
        cases = {"": cases} if isinstance(cases, Evidence) else cases
        words[claim.evidence] = combined([claim.verdict(one, case) for case, one in cases.items()])
    return words


class AnyFigure(dict):
    """Panels for whatever figure a template asks for."""

    def __missing__(self, name: str) -> list[Panel]:
        return [Panel(f"figures/{name}.svg", 10, 10)]
