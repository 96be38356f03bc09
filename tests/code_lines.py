"""`python -m tests.code_lines [DEPTH]` counts lines of code, without docstrings and comments."""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from collections import Counter
from collections.abc import Sequence

from tests.test_layout import ROOT, tracked_files

_NO_CODE = {
    tokenize.COMMENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
    tokenize.INDENT,
    tokenize.NEWLINE,
    tokenize.NL,
}


def code_lines(text: str) -> int:
    """Return how many lines of a module's text hold code; a string over three lines is three."""
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in _NO_CODE:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(getattr(node.value, "value", None), str):
            lines.difference_update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(lines)


def main(arguments: Sequence[str]) -> int:
    """Print the lines and files of each folder down to a depth, and the sums."""
    depth = int(arguments[0]) if arguments else 1
    lines: Counter[str] = Counter()
    files: Counter[str] = Counter()
    for path in tracked_files():
        if path.suffix == ".py" and not path.is_symlink():
            folder = "/".join(path.relative_to(ROOT).parts[:-1][:depth])
            lines[folder] += code_lines(path.read_text(encoding="utf-8"))
            files[folder] += 1
    for folder in sorted(lines):
        print(f"{lines[folder]:7d} {files[folder]:4d} {folder}")
    tests = sum(count for folder, count in lines.items() if folder.split("/")[0] == "tests")
    print(f"{lines.total() - tests:7d} outside tests, {tests} in tests")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
