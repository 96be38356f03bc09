"""Who uses what was changed: the modules that import a changed name of another.

A module's own tests are not the only ones that ask for what it says: how far ahead a path is looked
at stands in the contracts, and the tests of the room that looks are those that notice.
"""

from __future__ import annotations

import ast
from functools import cache

from tests.test_mirrored import modules

MOST_USERS = 12
"""Of a type that a hundred modules use so many are asked."""


def users_of(module: str, text: str) -> list[str]:
    """Return the modules that import a name which a changed text of a module no longer defines as
    before, itself or through others of the module; at most MOST_USERS, in the order of names."""
    was = modules()[module].read_text(encoding="utf-8")
    names = _reached_by(_changed(was, text), _uses(was))
    found = [user for user, taken in sorted(_taken(module).items()) if taken & names]
    return found[:MOST_USERS]


def _changed(was: str, now: str) -> set[str]:
    """Return the names at the top of a module that stand for something else in its new text."""
    before, after = _definitions(was), _definitions(now)
    return {name for name in before if before[name] != after.get(name)}


def _definitions(text: str) -> dict[str, str]:
    found = {}
    for node in ast.parse(text).body:
        for name in _names(node):
            found[name] = ast.dump(node)
    return found


def _names(node: ast.stmt) -> list[str]:
    if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.AsyncFunctionDef):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", node)]
    return [one.id for target in targets for one in ast.walk(target) if isinstance(one, ast.Name)]


def _uses(text: str) -> dict[str, set[str]]:
    """Return which names each definition of a module mentions."""
    return {
        name: {one.id for one in ast.walk(node) if isinstance(one, ast.Name)} - {name}
        for node in ast.parse(text).body
        for name in _names(node)
    }


def _reached_by(changed: set[str], uses: dict[str, set[str]]) -> set[str]:
    """Return the changed names and all that are made of them."""
    reached = set(changed)
    while more := {name for name, used in uses.items() if used & reached} - reached:
        reached |= more
    return reached


@cache
def _taken(module: str) -> dict[str, frozenset[str]]:
    """Return which names other modules import from one."""
    found = {}
    for user, path in modules().items():
        text = path.read_text(encoding="utf-8")
        if user == module or module not in text:
            continue
        taken = {
            one.name
            for node in ast.walk(ast.parse(text))
            if isinstance(node, ast.ImportFrom) and node.module == module
            for one in node.names
        }
        found[user] = frozenset(taken)
    return found
