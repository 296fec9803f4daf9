"""Pages of the documentation that are made from the source, and their weights in the search.

The search knows no code, and guides come first.
"""

import ast
import re
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src"

KINDS = {"eq": "Equations", "figure": "Figures", "table": "Tables", "section": "Sections"}

SECTIONS = {"I": 3, "II": 5, "III": 5, "IV": 10, "V": 3}
"""Of each chapter; a lone number beyond them is an equation's."""

NUMBER = re.compile(
    r"\b(?:(?P<kind>eqs?\.|equations?|figures?|tables?|sections?|Figures?|Tables?|Equations?)\s+)?"
    r"(?P<number>(?:IV|V|I{1,3})\.\d+(?:\.\d+)*)\b"
)
FOLLOWS = re.compile(r"^(?:,? and|,| to|,? or|-|\u2013)\s*$")
RANGE = re.compile(r"^( to|-|\u2013)\s*$")
CAPTION = re.compile(r"\b(?:figure|table)\(\"(?P<name>\w+)[^,]*, \"(?P<caption>[^\"]*)\"")
"""The name and the caption of a figure or table of a page's template."""

LANGUAGES = {".py": "python", ".jinja": "html+jinja"}
GUIDES_FIRST = 5000.0
"""Weight of a guide in the search. The index and the API have 1, and a word in a heading, as every function's
name is, counts 1000 times as much as in the text."""


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
    """All citations in docstrings, comments and captions, by kind and number."""
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
    for path in sorted(source.rglob("*.jinja")):
        for line, text in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            for match in CAPTION.finditer(text):
                for kind, number in cited(match["caption"]):
                    place_of, summary = str(path.relative_to(source.parent)), match["caption"].split(":")[0]
                    found.add(Citation(kind, number, place_of, line, match["name"], summary))
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


def dissertation_page(found: list[Citation]) -> str:
    """The index, a table per kind; figures and tables also where the reports show them."""
    lines = [
        "# Index of the dissertation\n",
        "Where equations, figures, tables and sections of the dissertation are implemented or shown. The "
        "index is made from the citations in docstrings, comments and captions, and from the list of figures "
        'and tables on the <a href="../reports/index.html">front page</a> of the reports.\n',
    ]
    shown = yaml.safe_load((ROOT / "stages/report.yaml").read_text(encoding="utf-8"))["index"]
    for kind, title in KINDS.items():
        lines += [f"\n## {title}\n"]
        if kind in ("figure", "table"):
            lines += ["| | shows | in the reports | source |", "|---|---|---|---|"]
            for entry in shown:
                which, number = entry["what"].split()
                if which == kind:
                    lines.append(
                        f"| {number} | {entry['shows']} | {_shown_at(entry)} | {_code(found, kind, number)} |"
                    )
            continue
        lines += ["| | what | source |", "|---|---|---|"]
        lines += [
            f"| {one.number} | `{one.name}`: {_cell(one.summary)} | {_link(one, f'{one.path}:{one.line}')} |"
            for one in found
            if one.kind == kind
        ]
    return "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _shown_at(entry: dict[str, str]) -> str:
    """Where the reports show a figure or table, and how it came out; HTML, as mkdocs knows no reports."""
    result = entry["result"] + (f": {_cell(entry['why'])}" if "why" in entry else "")
    page = entry.get("page")
    return f'<a href="../reports/{page}">{result}</a>' if page else result


def _link(one: Citation, text: str) -> str:
    return f"[`{text}`]({source_page(one.path)}#__codelineno-0-{one.line})"


def _code(found: list[Citation], kind: str, number: str) -> str:
    """Links to what cites a figure or table, each name of a file once."""
    cites = {(one.name, one.path): one for one in reversed(found) if (one.kind, one.number) == (kind, number)}
    return ", ".join(_link(one, name) for (name, _), one in sorted(cites.items()))


def source_page(path: str) -> str:
    """The page of a file of the source, which has an anchor per line."""
    return f"source/{path.removeprefix('src/').replace('/', '.')}.md"


def source_pages(found: list[Citation]) -> dict[str, str]:
    """A page per file that the index names, so that its links lead to lines without a network."""
    pages = {}
    for path in sorted({one.path for one in found}):
        text = (ROOT / path).read_text(encoding="utf-8").rstrip("\n")
        language = LANGUAGES[Path(path).suffix]
        pages[source_page(path)] = f'# {path}\n\n~~~~~ {{.{language} linenums="1"}}\n{text}\n~~~~~\n'
    return pages


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


def notebook_page() -> dict[str, str | bytes]:
    """The notebook as a page, and its pictures; its links begin at the folder of the examples."""
    from nbconvert import MarkdownExporter

    text, files = MarkdownExporter().from_filename(ROOT / "examples/pick.ipynb")
    pictures = {f"notebook/{name}": content for name, content in files["outputs"].items()}
    for name in files["outputs"]:
        text = text.replace(f"]({name})", f"](notebook/{name})")
    return {"notebook.md": text.replace("](../docs/", "]("), **pictures}


def on_files(files, config):
    """Add the pages that are made here (a hook of mkdocs)."""
    from mkdocs.structure.files import File

    found = citations()
    for name, content in {
        "dissertation.md": dissertation_page(found),
        **notebook_page(),
        **source_pages(found),
        **api_pages(),
    }.items():
        files.append(File.generated(config, name, content=content))
    return files


def on_page_markdown(markdown, page, config, files):
    """Weights of pages in the search (a hook of mkdocs)."""
    folder, _, name = page.file.src_uri.rpartition("/")
    if folder == "source":
        page.meta |= {"search": {"exclude": True}, "hide": ["navigation", "toc"]}
    elif not folder and name != "dissertation.md":
        page.meta["search"] = {"boost": GUIDES_FIRST}


def on_page_content(html, page, config, files):
    """Code below the functions of the API is shown and not searched (a hook of mkdocs)."""
    return html.replace(
        '<details class="mkdocstrings-source">', '<details class="mkdocstrings-source" data-search-exclude>'
    )
