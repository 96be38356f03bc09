"""Numbers of behaviour stand once, each with its reason."""

from __future__ import annotations

import ast
import functools
from collections.abc import Iterable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = ("contracts", "geometry", "telemetry", "world_gen", "sim_worker", "orchestrator", "viewer")
TABLES = (
    "sim_worker/driver_model.py",
    "geometry/steering.py",
    "telemetry/estimator/motion_noise.py",
)


@functools.cache
def numbers(module: str) -> dict[str, tuple[str, str]]:
    """Return the constants of a module that hold numbers: value and docstring by bare name."""
    body = ast.parse((ROOT / module).read_text(encoding="utf-8")).body
    found = {}
    for node, after in zip(body, [*body[1:], None], strict=True):
        if not isinstance(node, ast.Assign):
            continue
        target = node.targets[0]
        pairs = [(target, node.value)]
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            pairs = list(zip(target.elts, node.value.elts, strict=True))
        told = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
        doc = str(after.value.value) if told else ""
        for name, value in pairs:
            if isinstance(name, ast.Name) and name.id.isupper() and _is_number(value):
                found[name.id.strip("_")] = (ast.unparse(value), doc)
    return found


def _is_number(value: ast.expr) -> bool:
    leaves = [leaf.value for leaf in ast.walk(value) if isinstance(leaf, ast.Constant)]
    return bool(leaves) and all(isinstance(leaf, int | float) for leaf in leaves)


def _names_any(path: Path, names: Iterable[str]) -> bool:
    text = path.read_text(encoding="utf-8")
    return any(name in text for name in names)


@pytest.mark.parametrize("table", TABLES)
def test_every_number_of_a_table_says_what_it_is_and_why(table: str) -> None:
    given = numbers(table)
    assert given
    assert [name for name, (_, doc) in given.items() if not doc] == []


@pytest.mark.parametrize("table", TABLES)
def test_no_number_of_a_table_stands_elsewhere_too(table: str) -> None:
    given = numbers(table)
    elsewhere = [
        (module, name)
        for path in (path for room in ROOMS for path in (ROOT / room).rglob("*.py"))
        if (module := path.relative_to(ROOT).as_posix()) != table and _names_any(path, given)
        for name, (value, _) in numbers(module).items()
        if name in given and given[name][0] == value
    ]
    assert elsewhere == []
