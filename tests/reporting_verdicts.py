"""Verdicts on a page's claims from evidence alone, and a page's sentences without its figures being drawn."""

from collections.abc import Mapping
from importlib.resources import files

from dissertation.evidence.claims import combined, read_claims
from structlearn.reporting.document import Panel
from structlearn.reporting.evidence import Evidence, Found


def cases(package: str, found: Mapping[str, Found], file: str = "claims.yaml") -> dict[str, dict[str, str]]:
    """Verdicts on the cases of every claim, by the name of its evidence; every claim rests on its own."""
    words = {}
    for claim in read_claims(files(package) / file):
        parts = found[claim.evidence]
        parts = {"": parts} if isinstance(parts, Evidence) else parts
        words[claim.evidence] = {case: claim.verdict(one, case) for case, one in parts.items()}
    return words


def verdicts(package: str, found: Mapping[str, Found], file: str = "claims.yaml") -> dict[str, str]:
    """The same over all cases."""
    return {name: combined(list(words.values())) for name, words in cases(package, found, file).items()}


class AnyFigure(dict):
    """Panels for whatever figure a template asks for."""

    def __missing__(self, name: str) -> list[Panel]:
        return [Panel(f"figures/{name}.svg", 10, 10)]
