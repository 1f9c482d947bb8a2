# SPDX-License-Identifier: GPL-3.0-or-later
"""Pages that are encoded here are read by pyarrow, which has a reader of its own, and footers stay what they are."""

import io

import numpy as np
import pytest

from palpate.sweep import parquet_pages
from palpate.sweep import thrift_compact as thrift
from palpate.sweep.features import Feature
from palpate.sweep.lerobot_writer import _schema
from palpate.sweep.parquet_file import ParquetFile, chunk_of, chunks_of, footer_of
from palpate.sweep.parquet_pages import decode_column, encode_column, joined

pyarrow = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")

SHAPES = ((1,), (3,), (4, 1), (5, 3), (2, 3, 3), (3, 5, 7, 2))
KINDS = ("float32", "float64", "float16", "int64", "bool")


def feature_of(name: str, kind: str, shape: tuple[int, ...]) -> Feature:
    return Feature(name, kind, shape, (), "1", "")


def values_of(feature: Feature, rows: int, seed: int) -> np.ndarray:
    shape = (rows, *(() if feature.shape == (1,) else feature.shape))
    values = np.random.default_rng(seed).normal(scale=100.0, size=shape)
    return values > 0 if feature.dtype == "bool" else values.astype(feature.dtype)


def places_of(rows: int) -> pyarrow.Table:
    return pyarrow.table({name: np.arange(rows) for name in ("frame_index", "episode_index", "index", "task_index")})


@pytest.mark.parametrize("page_bytes", [1, 200, 1 << 20])
def test_pyarrow_reads_the_pages_of_all_types_and_shapes(tmp_path, monkeypatch, page_bytes):
    """Runs of several lengths, one frame included, in two groups of rows."""
    monkeypatch.setattr(parquet_pages, "PAGE_BYTES", page_bytes)
    features = [feature_of(f"a.{kind}.{len(shape)}{shape[0]}", kind, shape) for kind in KINDS for shape in SHAPES]
    time = feature_of("timestamp", "float32", (1,))
    file = ParquetFile(tmp_path / "a.parquet", _schema(tuple(features)))
    expected = {item.name: [] for item in (time, *features)}
    for group, lengths in enumerate(((1, 17, 8), (30,))):
        chunks = chunks_of(places_of(sum(lengths)))
        for item in (time, *features):
            runs = [values_of(item, rows, 7 * group + number) for number, rows in enumerate(lengths)]
            expected[item.name] += runs
            chunks[item.name] = chunk_of(item, joined([encode_column(item, run) for run in runs]))
        file.write(chunks, sum(lengths))
    file.close()
    table = parquet.read_table(tmp_path / "a.parquet")
    assert parquet.ParquetFile(tmp_path / "a.parquet").num_row_groups == 2
    table.validate(full=True)
    for name, runs in expected.items():
        whole = np.concatenate(runs)
        found = np.array(table.column(name).to_pylist(), whole.dtype).reshape(whole.shape)
        np.testing.assert_array_equal(found, whole, err_msg=name)
    assert table.column("index").to_pylist() == [*range(26), *range(30)]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("shape", SHAPES)
def test_what_was_encoded_is_decoded(monkeypatch, kind, shape):
    monkeypatch.setattr(parquet_pages, "PAGE_BYTES", 300)
    item = feature_of("a", kind, shape)
    runs = [values_of(item, rows, rows) for rows in (9, 1, 40)]
    np.testing.assert_array_equal(decode_column(item, joined([encode_column(item, run) for run in runs])), np.concatenate(runs))


def test_equal_columns_are_equal_bytes_in_any_order_in_memory():
    item = feature_of("a", "float32", (4, 6, 3))
    values = values_of(item, 20, 1)
    other = np.asfortranarray(values)
    assert not other.flags.c_contiguous
    assert encode_column(item, other) == encode_column(item, values)


@pytest.mark.parametrize("at", [0, 3, 30, -1])
def test_a_damaged_page_is_noticed(at):
    item = feature_of("a", "float32", (4, 6, 3))
    whole = encode_column(item, values_of(item, 20, 1))
    content = bytearray(whole.content)
    del content[at]
    with pytest.raises(ValueError):
        decode_column(item, parquet_pages.EncodedColumn(bytes(content), whole.size, whole.count))


def test_a_footer_of_pyarrow_stays_the_same_when_it_is_read_and_written():
    table = pyarrow.table(
        {
            "whole": pyarrow.array(range(-70, 3000)),
            "text": pyarrow.array(["a", "bc"] * 1535),
            "lists": pyarrow.array([[[1.5], [2.5, None]]] * 3070, pyarrow.list_(pyarrow.list_(pyarrow.float64()))),
            **{f"column {number}": pyarrow.array([True, None] * 1535) for number in range(20)},
        }
    )
    with io.BytesIO() as file:
        parquet.write_table(table, file, row_group_size=100, write_page_index=True)
        content = file.getvalue()
    size = int.from_bytes(content[-8:-4], "little")
    assert len(footer_of(content)[4][1][1]) == 31
    assert thrift.write_struct(footer_of(content)) == content[-8 - size : -8]


def test_a_file_that_is_not_of_parquet_is_refused():
    with pytest.raises(ValueError, match="no file of Parquet"):
        footer_of(b"PAR1" + bytes(20))
