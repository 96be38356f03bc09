"""`python -m tests.broken_lines` breaks lines on purpose and says which no test notices.

Lines are drawn over the whole program; a broken one stands in a checkout of HEAD alone, where the
tests run that mirror its module or name it in `COVERS`. Exit code 0 where each was noticed, else 3.
"""

from __future__ import annotations

import argparse
import ast
import random
import sys
from collections.abc import Sequence
from typing import Any, NamedTuple

from tests.mutation.noticing import checkout
from tests.test_mirrored import modules

UNNOTICED = 3
_TURNED: dict[type[ast.AST], Any] = {
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.And: ast.Or,
    ast.Or: ast.And, ast.USub: ast.UAdd,
}  # fmt: skip


class Broken(NamedTuple):
    """One line broken: where, as it was, as it is, and the module's whole new text."""

    module: str
    line: int
    before: str
    after: str
    text: str


def main(arguments: Sequence[str]) -> int:
    """Break lines one after the other, print what became of each, and the count."""
    parser = argparse.ArgumentParser(prog="python -m tests.broken_lines", description=__doc__)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--room", default="", help="modules below this name alone")
    asked = parser.parse_args(arguments)
    draws = random.Random(asked.seed)
    named = [name for name in sorted(modules()) if name.startswith(f"foretwin.{asked.room}")]
    noticed = 0
    with checkout() as tree:
        for number in range(asked.count):
            broken = break_a_line(named, draws)
            seen = tree.fate(broken.module, broken.text, system=True) in ("killed", "timed out")
            noticed += seen
            word = "noticed" if seen else "UNNOTICED"
            print(f"{number + 1:3d} {word:9s} {broken.module}:{broken.line}")
            print(f"      - {broken.before}\n      + {broken.after}", flush=True)
    print(f"{noticed} of {asked.count} noticed")
    return 0 if noticed == asked.count else UNNOTICED


def break_a_line(named: Sequence[str], draws: random.Random) -> Broken:
    """Draw a statement, each one as likely as any other, and break it."""
    while True:
        module = draws.choices(named, [_length(name) for name in named])[0]
        text = modules()[module].read_text(encoding="utf-8")
        tree = ast.parse(text)
        nodes = [node for node in ast.walk(tree) if isinstance(node, ast.expr | ast.Return)]
        places = [node for node in nodes if _can_break(node)]
        if places:
            return _broken(module, text, draws.choice(places))


def _length(module: str) -> int:
    return len(modules()[module].read_text(encoding="utf-8").splitlines())


def _can_break(node: ast.expr | ast.Return) -> bool:
    if isinstance(node, ast.Compare):
        return len(node.ops) == 1
    if isinstance(node, ast.BinOp | ast.UnaryOp):
        return type(node.op) in _TURNED
    if isinstance(node, ast.Constant):
        return type(node.value) in (int, float)
    return isinstance(node, ast.BoolOp) or (isinstance(node, ast.Return) and node.value is not None)


def _broken(module: str, text: str, node: ast.expr | ast.Return) -> Broken:
    """Replace the node's own characters, so that all others stay as they are."""
    before = ast.get_source_segment(text, node) or ""
    if isinstance(node, ast.Compare):
        node.ops = [_TURNED[type(node.ops[0])]()]
    elif isinstance(node, ast.BinOp | ast.UnaryOp | ast.BoolOp):
        node.op = _TURNED[type(node.op)]()
    elif isinstance(node, ast.Constant) and isinstance(node.value, float):
        node.value = node.value * 1.5 + 0.25
    elif isinstance(node, ast.Constant) and isinstance(node.value, int):
        node.value += 1
    elif isinstance(node, ast.Return):
        node.value = ast.Constant(None)
    after = ast.unparse(node) if isinstance(node, ast.Return) else f"({ast.unparse(node)})"
    assert node.end_lineno is not None
    assert node.end_col_offset is not None
    start = _place(text, node.lineno, node.col_offset)
    end = _place(text, node.end_lineno, node.end_col_offset)
    return Broken(module, node.lineno, before, after, text[:start] + after + text[end:])


def _place(text: str, line: int, utf8_offset: int) -> int:
    lines = text.splitlines(keepends=True)
    before = sum(len(one) for one in lines[: line - 1])
    return before + len(lines[line - 1].encode()[:utf8_offset].decode())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
