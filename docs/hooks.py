"""Pages of the documentation that are made from the source: the index of the dissertation, and the API."""

import ast
import re
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

SOURCE = Path(__file__).parents[1] / "src"

KINDS = {"eq": "Equations", "figure": "Figures", "table": "Tables", "section": "Sections"}

SECTIONS = {"I": 3, "II": 5, "III": 5, "IV": 10, "V": 3}
"""Of each chapter; a lone number beyond them is an equation's."""

NUMBER = re.compile(
    r"\b(?:(?P<kind>eqs?\.|equations?|figures?|tables?|sections?|Figures?|Tables?|Equations?)\s+)?"
    r"(?P<number>(?:IV|V|I{1,3})\.\d+(?:\.\d+)*)\b"
)
FOLLOWS = re.compile(r"^(?:,? and|,| to|,? or|-|\u2013)\s*$")
RANGE = re.compile(r"^( to|-|\u2013)\s*$")


@dataclass(frozen=True, order=True)
class Citation:
    """A place in the source that cites the dissertation."""

    kind: str
    number: str
    path: str
    line: int
    name: str
    summary: str


def citations(source: Path = SOURCE) -> list[Citation]:
    """All citations in docstrings and comments, by kind and number."""
    found: set[Citation] = set()
    for path in sorted(source.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if not isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                continue
            text = ast.get_docstring(node)
            if not text:
                continue
            name = getattr(node, "name", path.stem)
            line = getattr(node, "lineno", 1)
            summary = (
                re.sub(r"\s*\([^()]*\)", "", text.split("\n\n")[0].replace("\n", " ")).strip().rstrip(".")
            )
            for kind, number in cited(text):
                found.add(Citation(kind, number, str(path.relative_to(source.parent)), line, name, summary))
        with path.open("rb") as file:
            comments = [token for token in tokenize.tokenize(file.readline) if token.type == tokenize.COMMENT]
        for token in comments:
            summary = token.string.removeprefix("#").strip()
            for kind, number in cited(summary):
                place_of = str(path.relative_to(source.parent))
                found.add(Citation(kind, number, place_of, token.start[0], path.stem, summary))
    return sorted(found, key=lambda one: (list(KINDS).index(one.kind), place(one.number), one.path, one.line))


def cited(text: str) -> Iterator[tuple[str, str]]:
    """Kind and number of what a text cites; a list has the kind of its first number."""
    end, last, before = -1, "", ("", "0")
    for match in NUMBER.finditer(text):
        number, word = match["number"], (match["kind"] or "").lower()
        if word:
            kind = next(one for one in KINDS if word.startswith(one))
        elif end >= 0 and FOLLOWS.match(text[end : match.start()]):
            kind = last
        else:
            chapter, first, *rest = number.split(".")
            kind = "eq" if not rest and int(first) > SECTIONS[chapter] else "section"
        if kind == "eq" and number.count(".") > 1:
            kind = "section"
        chapter, *rest = number.split(".")
        if (
            RANGE.match(text[end : match.start()] if end >= 0 else "")
            and before[0] == chapter
            and len(rest) == 1
        ):
            yield from ((kind, f"{chapter}.{one}") for one in range(int(before[1]) + 1, int(rest[0])))
        before = chapter, rest[0]
        end, last = match.end(), kind
        yield kind, number


def place(number: str) -> tuple[int, ...]:
    """Order of a number within the dissertation."""
    chapter, *rest = number.split(".")
    return (list(SECTIONS).index(chapter), *map(int, rest))


def dissertation_page() -> str:
    """The index, a table per kind."""
    lines = [
        "# Index of the dissertation\n",
        "Where equations, figures, tables and sections of the dissertation are implemented or shown. The "
        "index is made from the citations in docstrings and comments.\n",
    ]
    found = citations()
    for kind, title in KINDS.items():
        lines += [f"\n## {title}\n", "| | what | where |", "|---|---|---|"]
        for one in found:
            if one.kind == kind:
                where = f"`{one.path}:{one.line}`"
                lines.append(
                    f"| {one.number} | `{one.name}`: {one.summary.replace('|', chr(92) + '|')} | {where} |"
                )
    return "\n".join(lines) + "\n"


def api_pages() -> dict[str, str]:
    """A page per package of the library, and the list of them."""
    root = SOURCE / "structlearn"
    pages, listed = {}, ["# API\n", "One page per package, lowest first.\n"]
    for package in sorted(path.parent for path in root.rglob("__init__.py")):
        modules = sorted(path for path in package.glob("*.py") if path.stem != "__init__")
        if not modules or package == root:
            continue
        name = package.relative_to(root).as_posix().replace("/", ".")
        head = ast.get_docstring(ast.parse((package / "__init__.py").read_text(encoding="utf-8"))) or ""
        body = "\n\n".join(f"::: structlearn.{name}.{module.stem}" for module in modules)
        pages[f"api/{name}.md"] = f"# {name}\n\n{head}\n\n{body}\n"
        listed.append(f"- [{name}]({name}.md): {head.splitlines()[0] if head else ''}")
    return {"api/index.md": "\n".join(listed) + "\n", **pages}


def on_files(files, config):
    """Add the pages that are made here (a hook of mkdocs)."""
    from mkdocs.structure.files import File

    for name, content in {"dissertation.md": dissertation_page(), **api_pages()}.items():
        files.append(File.generated(config, name, content=content))
    return files
