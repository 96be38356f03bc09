"""SQL over the tables of many runs: DuckDB, locked so that a question can only read them."""

from __future__ import annotations

import datetime
import difflib
import re
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import duckdb
import pyarrow as pa
import pyarrow.dataset as ds

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.across.tables import RUN, RUN_ID, RunTables, TableSource

LOCKED: dict[str, str | bool | int | float | list[str]] = {
    "enable_external_access": False,
    "autoinstall_known_extensions": False,
    "autoload_known_extensions": False,
    "allow_community_extensions": False,
    "allow_persistent_secrets": False,
    "python_enable_replacements": False,
    "temp_directory": "",
}
"""No file, no network, no extension, no variable of this program, nothing spilt to a disk."""
_ALL_LISTED = 30
"""So many columns are listed where one was misspelt, else the nearest."""
_COLUMN = re.compile(r'(?:Referenced column|does not have a column named|column) "([^"]+)"')
_TABLE = re.compile(r'Table with name "?([^"]+?)"? does not exist')
_ZONED = "TIMESTAMP WITH TIME ZONE"


class AskedRows(NamedTuple):
    """Rows of a question, and the names of their columns, each another one."""

    columns: list[str]
    rows: list[tuple[Any, ...]]


def ask(tables: RunTables, sql: str) -> AskedRows:
    """Return what a SELECT over the tables comes to.

    Raises UserError in one line where the SQL is wrong, is no SELECT, or names what is not there.
    """
    names = tables_asked(tables, sql)
    try:
        return _answered(tables, names, sql)
    except duckdb.CatalogException as error:
        lacks = _TABLE.search(str(error))
        if lacks is None:
            raise UserError(f"query: {_why(error)}") from error
        names.append(lacks[1].lower())
    except (OSError, pa.ArrowException, duckdb.Error) as error:
        if not tables.leave_out_damaged(names):
            raise UserError(f"query: {_why(error)}") from error
    return _answered(tables, names, sql)


def tables_asked(tables: RunTables, sql: str) -> list[str]:
    """Return the tables that a question names, as SQL does in letters of any case.

    Raises UserError for anything but one SELECT.
    """
    parser = duckdb.connect(":memory:", config=LOCKED)
    try:
        kinds = [one.type.name for one in parser.extract_statements(sql)]
        if len(kinds) != 1 or kinds[0] not in ("SELECT", "EXPLAIN", "MULTI"):
            raise UserError("query: one SELECT is asked for; runs are read, never changed")
        if kinds[0] != "MULTI":  # as PIVOT is
            return sorted({one.lower() for one in parser.get_table_names(sql)}) or tables.names
    except duckdb.ParserException as error:
        raise UserError(f"query: {_why(error)}") from error
    except duckdb.Error:  # of JOIN … USING: it looks at columns of tables that are not there yet
        pass
    finally:
        parser.close()
    words = set(re.findall(r"\w+", sql.lower()))
    return [name for name in tables.names if name in words]


def columns_in(tables: RunTables, names: Iterable[str]) -> dict[str, dict[str, str]]:
    """Return the columns of views with their types in SQL."""
    views = list(names)
    with _database(tables, views) as database:
        return {
            view: {row[0]: row[1] for row in database.execute(f'DESCRIBE "{view}"').fetchall()}
            for view in views
        }


def _answered(tables: RunTables, names: Sequence[str], sql: str) -> AskedRows:
    with _database(tables, names) as database:
        try:
            described = database.execute(sql).description
            rows = _rows_of(database, sql, [str(kind) for _, kind, *_ in described])
            return AskedRows(_each_another([name for name, *_ in described]), rows)
        except duckdb.BinderException as error:
            columns = {
                name: [row[0] for row in database.execute(f'DESCRIBE "{name}"').fetchall()]
                for name in names
            }
            raise UserError(f"query: {_with_columns(error, columns)}") from error
        except duckdb.InterruptException as error:
            raise KeyboardInterrupt from error


def _rows_of(
    database: duckdb.DuckDBPyConnection, sql: str, kinds: Sequence[str]
) -> list[tuple[Any, ...]]:
    """Return the rows of a question that was just executed; its columns are of these types.

    Of an instant with a time zone DuckDB makes no Python object without the package pytz: its text
    is asked for instead.
    """
    if not any(_ZONED in kind for kind in kinds):
        return database.fetchall()
    told = (f"#{n}::{kind.replace(_ZONED, 'VARCHAR')}" for n, kind in enumerate(kinds, start=1))
    database.execute(f'CREATE TEMP TABLE "the answer" AS {sql}')
    rows = database.execute(f'SELECT {", ".join(told)} FROM "the answer"').fetchall()
    return [
        tuple(
            _instant(cell) if kind == _ZONED else cell
            for cell, kind in zip(row, kinds, strict=True)
        )
        for row in rows
    ]


def _instant(text: str | None) -> datetime.datetime | str | None:
    """Return the instant of a text of DuckDB, the text where Python has none, as of infinity."""
    try:
        return text and datetime.datetime.fromisoformat(text)
    except ValueError:
        return text


def _each_another(names: Sequence[str]) -> list[str]:
    """Return names of columns with those that came before numbered, as DuckDB does in a view."""
    found: dict[str, None] = {}
    for name in names:
        number, told = 0, name
        while told in found or (number and told in names):
            number += 1
            told = f"{name}_{number}"
        found[told] = None
    return list(found)


def _database(tables: RunTables, names: Sequence[str]) -> duckdb.DuckDBPyConnection:
    database = duckdb.connect(":memory:", config=LOCKED)
    for name in names:
        _add_view(database, name, tables.sources(name) or [_empty(tables, name)])
    database.execute("SET lock_configuration = true")
    return database


def _add_view(
    database: duckdb.DuckDBPyConnection, name: str, sources: Sequence[TableSource]
) -> None:
    if len(sources) == 1 and not sources[0].of_lake:
        database.register(name, sources[0].rows)
        return
    parts = []
    for number, source in enumerate(sources):
        part = f"{name} of place {number + 1}"
        database.register(part, source.rows)
        if source.of_lake:
            others = f'SELECT {RUN_ID} AS {RUN}, * EXCLUDE ({RUN_ID}) FROM "{part}"'
            again = ", ".join(f"""'{run.replace("'", "''")}'""" for run in source.without)
            parts.append(f"{others} WHERE {RUN_ID} NOT IN ({again})" if again else others)
        else:
            parts.append(f'SELECT * FROM "{part}"')
    database.execute(f'CREATE VIEW "{name}" AS {" UNION ALL BY NAME ".join(parts)}')


def _empty(tables: RunTables, name: str) -> TableSource:
    """Return a table without rows that no run has, with the columns that it would have."""
    from foretwin.orchestrator.record.results import TABLES  # takes a second, and is seldom wanted

    if name not in TABLES:
        known = sorted({*tables.names, *TABLES})
        raise UserError(f"query: no table {name!r}{_nearest(name, known)}: {', '.join(known)}")
    named = pa.schema([(RUN, pa.string()), *TABLES[name]])
    return TableSource(ds.InMemoryDataset(named.empty_table()))


def _with_columns(error: Exception, columns: dict[str, list[str]]) -> str:
    why = str(error).partition("\n")[0]
    named = _COLUMN.search(why)
    if named is None:
        return _why(error)
    if not columns:
        return _why(error)
    known = list(dict.fromkeys(column for of in columns.values() for column in of))
    told = f"no column {named[1]!r}{_nearest(named[1], known)}"
    for view, of in columns.items():
        if len(of) <= _ALL_LISTED:
            told += f"; {view} has {', '.join(of)}"
        else:
            told += f"; DESCRIBE {view} lists its {len(of)} columns"
    return told


def _nearest(name: str, known: Sequence[str]) -> str:
    near = difflib.get_close_matches(name, known, n=3)
    return f" (did you mean {' or '.join(near)}?)" if near else ""


def _why(error: Exception) -> str:
    """Return what DuckDB says, less the picture of where, in one line."""
    said, _, where = str(error).partition("\n\nLINE ")
    first = said.partition("\n")[0]
    return f"{first} (in line {where.partition(':')[0]})" if where else " ".join(said.split())
