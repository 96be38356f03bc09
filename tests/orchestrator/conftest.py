"""What holds for all tests of the orchestrator."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from foretwin.orchestrator.record.table_stream import TableStream


@pytest.fixture(autouse=True, scope="module")
def streams_end_with_their_module() -> Iterator[None]:
    """Close the results that tests leave open: `select` takes no file beyond the 1,024th."""
    opened: dict[int, TableStream] = {}
    begin, close = TableStream.__init__, TableStream.close

    def opening(stream: TableStream, *what: object, **how: object) -> None:
        begin(stream, *what, **how)  # type: ignore[arg-type]
        opened[id(stream)] = stream

    def closing(stream: TableStream) -> None:
        opened.pop(id(stream), None)
        close(stream)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TableStream, "__init__", opening)
        patch.setattr(TableStream, "close", closing)
        yield
    for stream in opened.values():
        os.close(stream._descriptor)
