"""What holds for all tests of the orchestrator."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from foretwin.orchestrator.record.results import ResultTables


@pytest.fixture(autouse=True, scope="module")
def tables_end_with_their_module() -> Iterator[None]:
    """End the results that tests leave open, some 25 files each and a thread that writes them:
    `select` takes no file beyond the 1,024th."""
    begun: list[ResultTables] = []
    begin = ResultTables.__init__

    def beginning(tables: ResultTables, *what: object, **how: object) -> None:
        begin(tables, *what, **how)  # type: ignore[arg-type]
        begun.append(tables)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ResultTables, "__init__", beginning)
        yield
    for tables in begun:
        tables.leave()
