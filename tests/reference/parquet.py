#!/usr/bin/env python3
"""Writes demonstrations as pyarrow does, for the tests of the reader; and reads one as pandas does.

    pip install pyarrow pandas
    python parquet.py              writes pyarrow_*.parquet beside this file
    python parquet.py DEMO.parquet prints what pyarrow and pandas see in a demonstration that mcpo-run wrote
"""

import pathlib
import sys

import pyarrow
import pyarrow.parquet

FOLDER = pathlib.Path(__file__).parent


def write():
    n = 40
    table = pyarrow.table(
        {
            "episode": [0 if j < 25 else 3 for j in range(n)],
            "step": pyarrow.array([j if j < 25 else j - 25 for j in range(n)], pyarrow.int32()),
            "note": ["a column that is ignored"] * n,
            "observation": [[j // 3 + 0.25 * i for i in range(4)] for j in range(n)],
            "action": [[(j + 1) / (i + 3) for i in range(2)] for j in range(n)],
            "reward": [float(j % 2) for j in range(n)],
            "terminated": [j == 24 for j in range(n)],
            "truncated": [j == 39 for j in range(n)],
        }
    ).replace_schema_metadata({"env": "none"})
    write_table = pyarrow.parquet.write_table
    write_table(table, FOLDER / "pyarrow_snappy.parquet")
    write_table(
        table, FOLDER / "pyarrow_v2_zstd.parquet", data_page_version="2.0", compression="zstd", row_group_size=15
    )
    write_table(table, FOLDER / "pyarrow_plain_gzip.parquet", use_dictionary=False, compression="gzip")


def show(path):
    import pandas

    file = pyarrow.parquet.ParquetFile(path)
    print(file.schema_arrow)
    print(file.read().to_pandas().head(3))
    assert len(pandas.read_parquet(path)) == file.metadata.num_rows


if __name__ == "__main__":
    show(sys.argv[1]) if len(sys.argv) > 1 else write()
