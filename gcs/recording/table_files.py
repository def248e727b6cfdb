"""Tables on the disk, as CSV or Parquet: a file each in one folder, written row by row, and what their columns mean.

The same columns and values in both. What was not told, and NaN, is an empty cell in CSV and null in Parquet.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, TextIO

import orjson

from gcs.choices import BadUsageError
from gcs.recording.tables import Table
from gcs.recording.tidy import Row

MEANINGS = "columns.json"
"""Beside the tables: what they and their columns mean."""
BATCH_ROWS = 16_384
"""That are held of each table."""


class TableFile(Protocol):
    """One table on the disk."""

    def write(self, rows: list[Row]) -> None:
        """Add rows. Raises OSError."""
        ...

    def close(self) -> None:
        """Finish it. Raises OSError."""
        ...


class TableFolder:
    """A folder of tables."""

    def __init__(self, folder: Path, kind: Callable[[Path, Table], TableFile]) -> None:
        """folder: which is there. kind: CsvFile or ParquetFile."""
        self._folder = folder
        self._kind = kind
        self._closing = ExitStack()
        self._files: dict[str, TableFile] = {}
        self._waiting: dict[str, list[Row]] = {}
        self._tables: dict[str, Table] = {}
        self.rows: dict[str, int] = {}
        """Name of a table → how many it has, complete when the folder is closed."""

    def __enter__(self) -> TableFolder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """All that waits is written, unless something went wrong."""
        with self._closing:
            if error is None:
                for name in self._waiting:
                    self._flush(name)
                self._meanings()

    def make(self, table: Table) -> None:
        """A table is there, with or without rows. Raises OSError."""
        name = table.name
        if name not in self._files:
            file = self._files[name] = self._kind(self._folder / name, table)
            self._closing.callback(file.close)
            self._tables[name], self._waiting[name], self.rows[name] = table, [], 0

    def add(self, table: Table, row: Row) -> None:
        """One more row of a table. Raises OSError."""
        waiting = self._waiting.get(table.name)
        if waiting is None:
            self.make(table)
            waiting = self._waiting[table.name]
        waiting.append(row)
        if len(waiting) >= BATCH_ROWS:
            self._flush(table.name)

    def _flush(self, name: str) -> None:
        waiting = self._waiting[name]
        self._files[name].write(waiting)
        self.rows[name] += len(waiting)
        self._waiting[name] = []

    def _meanings(self) -> None:
        told = {
            name: {
                "rows": self.rows[name],
                "sentence": table.sentence,
                "columns": [
                    {"name": c.name, "type": c.type, "unit": c.unit, "axis": c.axis, "sentence": c.sentence}
                    for c in table.columns
                ],
            }
            for name, table in self._tables.items()
        }
        (self._folder / MEANINGS).write_bytes(orjson.dumps(told, option=orjson.OPT_INDENT_2))


class CsvFile:
    """Fields as in RFC 4180, lines that end in LF, the first of names; text is in quotes, a bool true or false."""

    def __init__(self, stem: Path, table: Table) -> None:
        self._file: TextIO = stem.with_name(f"{stem.name}.csv").open("w", encoding="utf-8", newline="")
        self._file.write(",".join(column.name for column in table.columns) + "\n")

    def write(self, rows: list[Row]) -> None:
        """Add rows. Raises OSError."""
        self._file.writelines(",".join(map(_cell, row)) + "\n" for row in rows)

    def close(self) -> None:
        """Finish it. Raises OSError."""
        self._file.close()


def _cell(value: Any) -> str:
    match value:
        case None:
            return ""
        case bool():
            return "true" if value else "false"
        case str():
            return '"' + value.replace('"', '""') + '"'
        case float() if value != value:
            return ""
    return repr(value)


class ParquetFile:
    """Typed columns, compressed."""

    def __init__(self, stem: Path, table: Table) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        self._pa = pa
        self._schema = pa.schema(
            [
                pa.field(column.name, pa.type_for_alias(column.type), metadata=_meaning(column.unit, column.sentence))
                for column in table.columns
            ]
        )
        self._file = pq.ParquetWriter(stem.with_name(f"{stem.name}.parquet"), self._schema)

    def write(self, rows: list[Row]) -> None:
        """Add rows. Raises OSError."""
        if rows:
            columns = zip(*rows, strict=True)
            arrays = [
                self._pa.array(values, type=field.type, from_pandas=True)  # so that NaN is null
                for values, field in zip(columns, self._schema, strict=True)
            ]
            self._file.write_batch(self._pa.record_batch(arrays, schema=self._schema))

    def close(self) -> None:
        """Finish it. Raises OSError."""
        self._file.close()


def _meaning(unit: str, sentence: str) -> dict[str, str]:
    return {key: said for key, said in (("unit", unit), ("sentence", sentence)) if said}


def parquet_file() -> Callable[[Path, Table], TableFile]:
    """ParquetFile, where it can be written. Raises BadUsageError where its extra is missing."""
    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError:
        raise BadUsageError("--to parquet needs pyarrow: pip install 'trustr[parquet]'") from None
    return ParquetFile
