"""Imports run downwards only, and the big libraries stay in their rooms."""

import ast
from pathlib import Path

FLOORS = (
    ("recordings", "primitives", "rigid_body", "tactile"),
    ("segmentation", "feedback"),
    ("policy_search", "obstacles"),
    ("simulation", "recorded"),
    ("reporting", "viewer"),
)
ROOMS = {
    "rerun": ("viewer",),
    "matplotlib": ("reporting",),
    "pybullet": ("simulation",),
    "pinocchio": ("simulation", "rigid_body"),
    "torch": ("feedback", "rigid_body", "tactile", "tensors.py"),
    "mcap": ("recordings",),
}


def modules(root: Path) -> dict[Path, set[str]]:
    """Every module of the package with the names that it imports."""
    found = {}
    for path in sorted((root / "src" / "structlearn").rglob("*.py")):
        names = set()
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
        found[path.relative_to(root / "src" / "structlearn")] = names
    return found


def floor(room: str) -> int:
    """Height of a package; modules beside the packages are the ground."""
    return next((height for height, rooms in enumerate(FLOORS, start=1) if room in rooms), 0)


def test_imports_run_downwards(root):
    for path, names in modules(root).items():
        room = path.parts[0] if len(path.parts) > 1 else ""
        for name in names:
            parts = name.split(".")
            if parts[0] == "structlearn" and len(parts) > 1 and floor(parts[1]) > 0:
                same = parts[1] == room
                assert same or floor(parts[1]) < floor(room), f"{path} imports {name}"


def test_big_libraries_stay_in_their_rooms(root):
    for path, names in modules(root).items():
        for library, rooms in ROOMS.items():
            if any(name.split(".")[0] == library for name in names):
                assert path.parts[0] in rooms, f"{path} imports {library}"


def test_nothing_is_pickled(root):
    for path, names in modules(root).items():
        assert not {"pickle", "joblib.dump", "joblib.load", "torch.save"} & names, path
