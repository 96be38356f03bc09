"""Draws mutants by the operators of cosmic-ray, in whose own environment it runs.

A JSON object {"root", "files", "seed", "count"} comes in, one {"places", "mutants"} goes out, each
mutant with its file, line, operator and text. Each place in the files is as likely as any other,
then each operator that can change it: of one `+` cosmic-ray makes a dozen mutants. A number that
has a name is trebled: nobody promised 120 m rather than 121. Left out is what changes no result of
any program that is right: annotations, protocols, that a type is frozen, what only a type checker
reads or a trace tells, that `zip` asserts equal lengths, and how much a cache keeps.
"""

from __future__ import annotations

import ast
import contextlib
import json
import random
import sys
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from cosmic_ray import plugins
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code

_LEFT_OUT = ("core/NoOp",)
_NUMBERS, _TREBLED = "core/NumberReplacer", "trebled"
_DECLARED = ("frozen", "slots", "kw_only")
_TRACED_OR_KEPT = ("traced(", "cache", "lru_cache", "functools.cache", "functools.lru_cache")
_ASSERTS_OR_KEEPS = ("zip", "lru_cache", "functools.lru_cache")


class Place(NamedTuple):
    """Where a mutant differs: file, and line and column where that begins."""

    file: str
    line: int
    column: int


class Change(NamedTuple):
    """What an operator does there: its name, and which of its changes in the file it is."""

    operator: str
    occurrence: int


def main() -> None:
    """Read what is asked for and print the mutants."""
    asked = json.load(sys.stdin)
    root, chance = Path(asked["root"]), random.Random(asked["seed"])
    places: dict[Place, list[Change]] = {}
    for file in asked["files"]:
        places.update(_places(root, file))
    mutants: list[dict[str, Any]] = []
    for place in chance.sample(sorted(places), len(places)):
        if len(mutants) == asked["count"]:
            break
        change = chance.choice(places[place])
        # Dotted names of exceptions in a tuple are too much for cosmic-ray 8.7, and of `**` before
        # a dict it makes what is no Python: these would be killed by every test.
        with contextlib.suppress(AttributeError, SyntaxError):
            text = _mutated(_read(root, place.file), place, change)
            ast.parse(text)
            mutants.append(
                {"file": place.file, "line": place.line, "operator": change.operator, "text": text}
            )
    json.dump({"places": len(places), "mutants": mutants}, sys.stdout)


def _mutated(text: str, place: Place, change: Change) -> str:
    if change.operator != _TREBLED:
        return mutate_code(text, _operator(change.operator), change.occurrence)
    lines = text.splitlines(keepends=True)
    line = lines[place.line - 1]
    number = line[place.column : change.occurrence]
    trebled = f"(3 * {number})" if ast.literal_eval(number) else "1"
    lines[place.line - 1] = line[: place.column] + trebled + line[change.occurrence :]
    return "".join(lines)


def _places(root: Path, file: str) -> dict[Place, list[Change]]:
    text = _read(root, file)
    nodes, unrun, lines = list(ast_nodes(get_ast(text))), _unrun(ast.parse(text)), text.splitlines()
    named = _named_numbers(ast.parse(text))
    found = defaultdict(list)
    starts: dict[str, list[tuple[int, int]]] = {}
    runs: dict[tuple[int, int], bool] = {}
    for node in named.values():
        found[Place(file, node.lineno, node.col_offset)].append(
            Change(_TREBLED, node.end_col_offset)
        )
    for name in plugins.operator_names():
        if name in _LEFT_OUT or plugins.get_operator(name).arguments():
            continue
        # An arithmetic operator stands where it stands, whatever takes its place.
        kind = name.rpartition("_")[0] if "ReplaceBinaryOperator" in name else name
        if kind not in starts:
            positions = _operator(name).mutation_positions
            starts[kind] = [start for node in nodes for start, _ in positions(node)]
        for occurrence, start in enumerate(starts[kind]):
            if start not in runs:
                runs[start] = _runs(start, lines, unrun)
            if runs[start] and not (name == _NUMBERS and start in named):
                found[Place(file, *start)].append(Change(name, occurrence))
    return found


def _runs(
    start: tuple[int, int],
    lines: Sequence[str],
    unrun: Sequence[tuple[tuple[int, int], tuple[int, int]]],
) -> bool:
    line, column = start
    if lines[line - 1][column : column + 2] == "*,":
        return False  # before arguments by name alone, no product
    # Of a decorator the place is that of its `@`.
    places = (start, (line, column + 1))
    return not any(first <= place < last for first, last in unrun for place in places)


def _named_numbers(tree: ast.Module) -> dict[tuple[int, int], Any]:
    """Return the numbers that stand in constants of the module, by where they begin."""
    found = {}
    for node in tree.body:
        targets = [node.target] if isinstance(node, ast.AnnAssign) else getattr(node, "targets", [])
        names = [name for one in targets for name in getattr(one, "elts", [one])]  # A, B = 1, 2
        if names and all(isinstance(one, ast.Name) and one.id.isupper() for one in names):
            for one in ast.walk(node):
                if isinstance(one, ast.Constant) and type(one.value) in (int, float):
                    found[(one.lineno, one.col_offset)] = one
    return found


def _unrun(tree: ast.Module) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Return where what is left out begins and ends."""
    nodes: list[Any] = []
    for node in ast.walk(tree):
        nodes += [getattr(node, name, None) for name in ("annotation", "returns")]
        declares = isinstance(node, ast.keyword) and node.arg in _DECLARED
        if isinstance(node, ast.Call) and ast.unparse(node.func) in _ASSERTS_OR_KEEPS:
            nodes += node.keywords
        protocol = isinstance(node, ast.ClassDef) and "Protocol" in map(ast.unparse, node.bases)
        nodes += [node] if declares or protocol else []
        for decorator in getattr(node, "decorator_list", []):
            nodes += [decorator] if ast.unparse(decorator).startswith(_TRACED_OR_KEPT) else []
        if isinstance(node, ast.If) and {"TYPE_CHECKING", "__name__"} & set(_names(node.test)):
            nodes.append(node.test)
    return [
        ((node.lineno, node.col_offset), (node.end_lineno, node.end_col_offset))
        for node in nodes
        if isinstance(node, ast.expr | ast.keyword | ast.ClassDef)
    ]


def _names(node: ast.expr) -> list[str]:
    return [one.id for one in ast.walk(node) if isinstance(one, ast.Name)]


def _operator(name: str) -> Any:
    return plugins.get_operator(name)()


def _read(root: Path, file: str) -> str:
    return (root / file).read_text(encoding="utf-8")


if __name__ == "__main__":
    main()
