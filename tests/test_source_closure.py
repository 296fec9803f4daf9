"""Which code a stage depends on, and which edits change that."""

from pathlib import Path

import pytest

from structlearn.core.source_closure import SourceTree

FILES = {
    "segment.py": "import numpy\nfrom structlearn.core.signals import low_pass",
    "train.py": "def main():\n    from structlearn.feedback import train\n",
    "report.py": "from structlearn.page import figures",
    "user.py": "from structlearn.tactile import Skin",
    "src/structlearn/__init__.py": "",
    "src/structlearn/core/signals.py": (
        '"""Filters."""\ndef low_pass(x: int):\n    """Smooth."""\n    return x\n'
    ),
    "src/structlearn/feedback/train.py": (
        "from importlib import import_module\n"
        "from structlearn.feedback import models\n"
        "def network(name):\n"
        "    return import_module(f'{models.__name__}.{name}')\n"
    ),
    "src/structlearn/feedback/models/__init__.py": "",
    "src/structlearn/feedback/models/pca.py": "from structlearn.core import signals",
    "src/structlearn/tactile/__init__.py": (
        "import lazy_loader\n__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)\n"
    ),
    "src/structlearn/tactile/__init__.pyi": "from .skins import Skin as Skin\nfrom .maps import Map as Map",
    "src/structlearn/tactile/skins.py": "class Skin:\n    pass",
    "src/structlearn/tactile/maps.py": "class Map:\n    pass",
    "src/structlearn/page/figures.py": "KIT = 'structlearn.kit.drawing'",
    "src/structlearn/page/page.html.jinja": "<h1>Cuts</h1>",
    "src/structlearn/page/parts/cuts.jinja": "cuts",
    "src/structlearn/page/notes.txt": "read by nobody",
    "src/structlearn/kit/drawing.py": "",
    "src/structlearn/kit/pages/other.py": "",
    "src/structlearn/kit/pages/claims.yaml": "of other pages",
}


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def lists(project: Path) -> dict[str, dict[str, str]]:
    sources = SourceTree(project / "src")
    return {
        script.stem: {path.name: digest for path, digest in sources.closure(script).items()}
        for script in project.glob("*.py")
    }


def test_all_that_is_imported_or_named_is_listed(project):
    assert {name: set(listed) for name, listed in lists(project).items()} == {
        "segment": {"__init__.py", "signals.py"},
        "train": {"__init__.py", "train.py", "pca.py", "signals.py"},
        "report": {"__init__.py", "figures.py", "page.html.jinja", "cuts.jinja", "drawing.py"},
        "user": {"__init__.py", "skins.py"},
    }


@pytest.mark.parametrize(
    ("file", "old", "new", "changed"),
    [
        ("core/signals.py", "return x", "return -x", {"segment", "train"}),
        ("core/signals.py", "return x", "return x, None", {"segment", "train"}),
        ("feedback/models/pca.py", "from", "import structlearn.kit.drawing\nfrom", {"train"}),
        ("page/page.html.jinja", "Cuts", "Cut points", {"report"}),
        ("tactile/skins.py", "pass", "size = 1", {"user"}),
        ("tactile/__init__.pyi", "from .skins", "from .maps", {"user"}),
        ("tactile/maps.py", "pass", "size = 1", set()),
        ("page/parts/cuts.jinja", "cuts", "cut points", {"report"}),
        ("core/signals.py", '"""Smooth."""', '"""Zero-phase."""', set()),
        ("core/signals.py", '"""Filters."""', "# Filters", set()),
        ("core/signals.py", "x: int", "x: float", set()),
        ("page/notes.txt", "nobody", "no one", set()),
    ],
)
def test_an_edit_changes_the_lists_of_those_who_use_it_and_wording_none(project, file, old, new, changed):
    before, path = lists(project), project / "src/structlearn" / file
    path.write_text(path.read_text().replace(old, new))
    after = lists(project)
    assert {name for name in before if before[name] != after[name]} == changed


def test_a_relative_import_is_refused(project):
    (project / "segment.py").write_text("from . import signals")
    with pytest.raises(SyntaxError, match="relative import in line 1"):
        lists(project)
