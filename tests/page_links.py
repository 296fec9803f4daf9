"""Links of pages and documents: what they name, and what of it is missing."""

import re
from functools import cache
from pathlib import Path

from structlearn.reporting.document import anchor

ELSEWHERE = re.compile(r"[a-z]+:|//")


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


def broken(path: Path, made: tuple[Path, ...] = ()) -> list[str]:
    """Links whose file or anchor is missing; `made`: files and folders that a command makes."""
    missing = []
    for link in sorted(links(path)):
        name, _, place = link.partition("#")
        target = (path.parent / name).resolve() if name else path
        if any(target.is_relative_to(its) for its in made):
            continue
        if not target.exists() or (place and place not in anchors(target)):
            missing.append(link)
    return missing
