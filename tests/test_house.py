"""What holds of the whole tree: one class, one name; folders for a while that outlive nobody."""

from __future__ import annotations

import ast
import re
from collections import defaultdict

import pytest

from tests.test_layout import ROOT, tracked_files

TWICE: frozenset[str] = frozenset()
"""Names of two classes still, all in sim_worker; only to become fewer."""


@pytest.fixture(scope="module")
def classes() -> dict[str, list[str]]:
    """Every class outside tests by its name: the files that define it, inner classes too."""
    found = defaultdict(list)
    for path in sorted(set(tracked_files())):
        name = str(path.relative_to(ROOT))
        if path.suffix == ".py" and not name.startswith("tests/"):
            text = path.read_text(encoding="utf-8")
            for node in ast.walk(ast.parse(text)) if "class " in text else ():
                if isinstance(node, ast.ClassDef):
                    found[node.name].append(name)
    return found


def test_no_class_has_the_name_of_another(classes: dict[str, list[str]]) -> None:
    assert len(classes) > 500
    twice = {name: files for name, files in classes.items() if len(files) > 1}

    assert {name: files for name, files in twice.items() if name not in TWICE} == {}
    assert TWICE - twice.keys() == set(), "no longer needed"


def test_names_that_stand_twice_stay_in_one_room(classes: dict[str, list[str]]) -> None:
    rooms = {file.split("/")[0] for name in TWICE for file in classes[name]}

    assert rooms <= {"sim_worker"}


MAKES_FOLDERS = {"contracts/owned_folder.py", "contracts/new_folder.py"}
"""Who makes them for all others, and who tries for a moment whether one can be made."""


def test_a_folder_for_a_while_is_gone_even_after_a_kill() -> None:
    made_by = {
        str(path.relative_to(ROOT))
        for path in tracked_files()
        if path.suffix == ".py" and path.relative_to(ROOT).parts[0] != "tests"
        for word in ("mkdtemp", "TemporaryDirectory")
        if f"tempfile.{word}" in path.read_text(encoding="utf-8")
    }
    assert made_by == MAKES_FOLDERS, "use contracts.owned_folder: the next one removes what is left"


def test_a_nought_has_no_sign_of_its_own() -> None:
    """`:+.2f` writes what is nearly nothing as -0.00; `:+z.2f` does not."""
    signed = re.compile(r":\+\.\d[efg]")
    texts = {
        path.relative_to(ROOT): path.read_text(encoding="utf-8")
        for path in tracked_files()
        if path.suffix == ".py" and path.relative_to(ROOT).parts[0] != "tests"
    }
    assert sum(len(re.findall(r":\+z\.\d", text)) for text in texts.values()) > 20
    assert {
        str(name): signed.findall(text) for name, text in texts.items() if signed.search(text)
    } == {}
