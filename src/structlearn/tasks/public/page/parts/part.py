"""What every part of the recorded data gives to the pages."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from structlearn.core.artefacts import Metrics
from structlearn.reporting.claims import Claim, Found, read_claims
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import Drawing
from structlearn.tasks.public.page.recorded_results import RecordedResults

Pictures = Mapping[str, Drawing | Sequence[Drawing]]


@dataclass(frozen=True)
class Part:
    """One set of recorded data on the pages.

    Beside its module stand `NAME_claims.yaml`, `NAME_glance.html.jinja` (its section of the index, with one
    picture) and `NAME.html.jinja` (its section of the page that goes into it). Claims, and the title of a
    page that has this part alone, must be readable without its facts.

    Attributes:
        name: of the part, and of these files.
        heading: of its section, and above its claims.
        page: that goes into it.
        needs: tables without which it is not shown.
        parameters: keys of `params.yaml` that its results were made with.
        metrics: flat.
        evidence: by the names of its claims.
        facts: what its sentences say beside the metrics.
        tables: by name; all become CSV files.
        pictures: by name.
    """

    name: str
    heading: str
    page: str
    needs: tuple[str, ...]
    parameters: tuple[str, ...]
    metrics: Callable[[RecordedResults], Metrics]
    evidence: Callable[[RecordedResults], Mapping[str, Found]]
    facts: Callable[[RecordedResults], Mapping[str, object]]
    tables: Callable[[RecordedResults], Mapping[str, Table]]
    pictures: Callable[[RecordedResults], Pictures]

    def there(self, results: RecordedResults) -> bool:
        """Whether there are data of it."""
        return set(self.needs) <= set(results.tables)

    @property
    def claims(self) -> list[Claim]:
        """In order."""
        return read_claims(Path(__file__).with_name(f"{self.name}_claims.yaml"))


def of(
    found: Callable[[RecordedResults], Any], make: Callable[[Any], Any]
) -> Callable[[RecordedResults], Any]:
    """What is made of the results that one set has found among all."""
    return lambda results: make(found(results))
