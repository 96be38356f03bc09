"""What holds of the tests themselves: every module has its test.

`tests/world_gen/roads/test_width.py` is the test of `world_gen/roads/width.py`. A test that
exercises further modules names them: `COVERS = ("foretwin.world_gen.roads.kerb",)`. It has to reach
what it names through its imports, or start the program as a whole (`tests/system`).
"""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

from tests.test_layout import ROOT, tracked_files

ROOMS = (
    "contracts", "foretwin", "geometry", "orchestrator", "sim_worker", "telemetry", "viewer",
    "world_gen",
)  # fmt: skip
NOT_YET = "not_covered_yet.txt"
"""In a room's folder of tests: its modules that no test names; only to become fewer."""
_MODULE = re.compile(r"\bforetwin(?:\.\w+)*")
_BESIDE = re.compile(r"([a-z_]+)\.[a-z_]+")


def test_every_module_is_mirrored_or_named_as_covered() -> None:
    missing = modules().keys() - mirrored() - covered().keys()

    assert sorted(missing - not_yet()) == [], "mirror it, or name it in the COVERS of its test"
    assert sorted(not_yet() - missing) == [], f"covered now: take it out of {NOT_YET}"


def test_what_a_test_names_is_there_and_not_mirrored_as_well() -> None:
    assert sorted(covered().keys() - modules().keys()) == []
    assert sorted(covered().keys() & mirrored()) == []


def test_a_test_reaches_what_it_says_it_covers() -> None:
    out_of_reach = {
        module: str(test)
        for module, tests in covered().items()
        for test in tests
        if test.parts[1] != "system" and module not in reached(".".join(test.with_suffix("").parts))
    }

    assert out_of_reach == {}


@cache
def modules() -> dict[str, Path]:
    """Every module of the program that holds a definition or a table, by its dotted name."""
    found = {}
    for path in tracked_files():
        relative = path.relative_to(ROOT)
        if path.suffix == ".py" and relative.parts[0] in ROOMS and _defines_something(path):
            parts = [part for part in relative.with_suffix("").parts if part != "__init__"]
            found[".".join(parts if parts[0] == "foretwin" else ["foretwin", *parts])] = path
    return found


def _defines_something(path: Path) -> bool:
    said = (ast.Import, ast.ImportFrom, ast.Expr)
    return any(not isinstance(node, said) for node in _tree(path).body)


def _tree(path: Path) -> ast.Module:
    # Not kept: with the trees of 2,000 files the collector of garbage takes longer than the parser.
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def mirrored() -> set[str]:
    """Return the modules that have a test file of their own name at the same place."""
    return {name for name, path in modules().items() if mirror_of(path).is_file()}


def mirror_of(path: Path) -> Path:
    relative = path.relative_to(ROOT)
    name = relative.parent.name if relative.stem == "__init__" else relative.stem
    return ROOT / "tests" / relative.parent / f"test_{name.strip('_')}.py"


@cache
def covered() -> dict[str, list[Path]]:
    """Return the modules named in the COVERS of tests, and those tests."""
    found: dict[str, list[Path]] = {}
    for path in tracked_files():
        if path.name.startswith("test_") and path.suffix == ".py" and _names_covered(path):
            for node in _tree(path).body:
                if isinstance(node, ast.Assign) and _is_covers(node):
                    for name in ast.literal_eval(node.value):
                        found.setdefault(name, []).append(path.relative_to(ROOT))
    return found


def _is_covers(node: ast.stmt) -> bool:
    return isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "COVERS"


def _names_covered(path: Path) -> bool:
    return "COVERS" in path.read_text(encoding="utf-8")


@cache
def not_yet() -> set[str]:
    """Return the modules whose tests are still to be named."""
    files = (ROOT / "tests").glob(f"*/{NOT_YET}")
    return {line for file in files for line in file.read_text(encoding="utf-8").split()}


def reached(test: str) -> set[str]:
    """Return what a test imports, directly or through what it imports."""
    seen: set[str] = set()
    left = [test]
    while left:
        name = left.pop()
        if name not in seen:
            seen.add(name)
            left += _imports(name)
    return seen


@cache
def _file_of(name: str) -> Path | None:
    path = modules().get(name)
    if path is None and name.startswith("tests."):
        path = ROOT / Path(*name.split(".")).with_suffix(".py")
    return path if path is not None and path.is_file() else None


@cache
def _imports(name: str) -> list[str]:
    """Return the modules of the program and of the tests that one imports or names in a string, as
    those that it starts, or of which it holds code."""
    path = _file_of(name)
    if path is None:
        return []
    text, found = path.read_text(encoding="utf-8"), []
    package = name.rpartition(".")[0]
    tree = ast.parse(text)
    # What a test claims to cover is no word of it that it does.
    tree.body = [node for node in tree.body if not _is_covers(node)]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            found += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            for named in _MODULE.findall(node.value):
                found += [named, f"{named}.__main__"]
            if beside := _BESIDE.fullmatch(node.value):  # a table names what stands there
                found.append(f"{package}.{beside[1]}")
    return [name for name in dict.fromkeys(found) if _file_of(name)]
