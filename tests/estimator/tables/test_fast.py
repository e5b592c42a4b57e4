"""The fast reader gives the same as the strict reader, to the last bit, or leaves the file to it."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from baryscope.estimator.tables import table, tracks
from baryscope.estimator.tables.fast import read_fast
from baryscope.estimator.tables.form import Form
from baryscope.estimator.tables.strict import read_strict
from baryscope.models.errors import InputError
from malformed import TRACKS

FORM = Form("numbers and names in CSV", ("time", "name", "x"), ("u", "v"), "name")
HEADER = ["time", "name", "x"]

finite = st.floats(allow_nan=False, allow_infinity=False)
written = st.one_of(
    finite.map(repr),
    finite.map("{:.25g}".format),  # more digits than a double has
    st.floats(-1e6, 1e6).map("{:.40f}".format),
    st.integers(-(10**25), 10**25).map(str),
    st.sampled_from(["", "-0", "+1", "5.", ".5", "9007199254740993", "5e-324", "2.4703282292062328e-324"]),
)
names = st.text(st.characters(exclude_categories=["Cs"], exclude_characters='\r\n",'), max_size=4)
# Texts that only one of the two readers may accept as a number, a cell or the end of a line.
odd = st.one_of(
    st.sampled_from(["nan", "NaN", "inf", "-Infinity", "1_0", "1e", "1e999", "0x1", "True", "NA", "null", "1,5", "١"]),
    st.sampled_from(
        ['""', '"1"', '" 1"', '"a,b"', '"a\nb"', '"a""b"', '"a"b', 'a"b', '"', "1\n", "1\r\n2", "\r", "\0"]
    ),
    st.text('0123456789.eE+-_,"\n\r\t\v naif', max_size=6),
)


def rows(numbers, texts):
    row = st.tuples(numbers, texts, numbers).map(",".join)
    return st.lists(row, min_size=1, max_size=6)


def assert_same(found, expected):
    assert found.labels == expected.labels
    np.testing.assert_array_equal(found.codes, expected.codes)
    assert list(found.numbers) == list(expected.numbers)
    for name, values in expected.numbers.items():
        np.testing.assert_array_equal(found.numbers[name].view(np.uint64), values.view(np.uint64))


@given(rows(written, names), st.sampled_from(["", "\n", "\n\n"]))
@example(["0,a,1", "0, a,2", "0,,3", "0,b ,4", "0,b,", ",,"], "")
def test_plain_files_go_the_fast_way_and_give_the_same(lines, end):
    text = ",".join(HEADER) + "\n" + "\n".join(lines) + end
    found = read_fast(text.encode(), HEADER, "name")
    assert found is not None
    assert_same(found, read_strict(text, "it", FORM))


def test_quoted_cells_go_the_fast_way_too():
    text = 'time,name,x\n0,"left",1\n"2","right","3"\n4,left,""\n'
    found = read_fast(text.encode(), HEADER, "name")
    assert found is not None
    assert_same(found, read_strict(text, "it", FORM))
    assert found.labels == ("left", "right")


def outcome(content, long, monkeypatch, form=FORM):
    monkeypatch.setattr(table, "LONG", long)
    try:
        return table.read_table(content, "it.csv", form).columns
    except InputError as error:
        return str(error)


HEADERS = ["time,name,x", "x, time ,name", '"name",x,time', "name,x,time,u,v", "time,name", "time,name,x,x", ""]


@given(
    st.sampled_from(["", "\ufeff", "\n"]),
    st.sampled_from(HEADERS),
    rows(st.one_of(written, odd), st.one_of(names, odd)),
    st.sampled_from(["\n", "\r\n", "\r", "\n\n"]),
)
@example("", "time,name,x", ["1,a", "1,a,2,3"], "\n")  # commas enough, in the wrong rows
@example("", "time,name,x", ['1,"a\n,,",2'], "\n")  # commas and line breaks enough, in a cell
def test_both_ways_have_the_same_outcome(begin, header, lines, end):
    content = (begin + end.join([header, *lines]) + end).encode()
    with pytest.MonkeyPatch.context() as patch:
        strict, fast = (outcome(content, long, patch) for long in (10**9, 0))
    if isinstance(strict, str):
        assert fast == strict
    else:
        assert_same(fast, strict)


@pytest.mark.parametrize("case", [case for case in TRACKS if TRACKS[case][0] is not None])
def test_malformed_tracks_are_refused_with_the_same_line(case, monkeypatch):
    text, _ = TRACKS[case]
    content = text if isinstance(text, bytes) else text.encode()
    fast, strict = (outcome(content, long, monkeypatch, tracks.FORM) for long in (0, 10**9))
    if isinstance(strict, str):
        assert fast == strict
    else:  # each row is valid, but not all rows together
        assert_same(fast, strict)


def test_a_long_file_in_which_labels_come_late_and_cells_are_empty():
    """Long enough to be read in pieces, by several threads."""
    rng = np.random.default_rng(5)
    count = 60_000
    values = list(map(repr, (rng.normal(size=count) * 10.0 ** rng.uniform(-300, 300, count)).tolist()))
    texts = [f" F{rng.integers(1 + row // 100)}" if row % 7 else "" for row in range(count)]
    rows = (
        f"{row},{text},{'' if row % 11 == 0 else value}"
        for row, (text, value) in enumerate(zip(texts, values, strict=True))
    )
    text = "\n".join([",".join(HEADER), *rows])
    assert len(text) > table.LONG
    assert_same(table.read_table(text.encode(), "it.csv", FORM).columns, read_strict(text, "it.csv", FORM))
    assert read_fast(text.encode(), HEADER, "name") is not None


def test_a_processor_too_old_for_polars(monkeypatch):
    """Polars says so by a warning when it is imported."""

    def complain(name, *_):
        raise RuntimeWarning(f"{name}: Missing required CPU features")

    monkeypatch.setattr("builtins.__import__", complain)
    assert read_fast(b"time,name,x\n0,a,1\n", HEADER, "name") is None


def test_lost_markers_as_pandas_writes_them_go_the_fast_way():
    """Its `na_rep` makes NaN of them; the bits of a NaN are those of the strict reader, whatever its sign."""
    for word in ("NaN", "nan", "-nan", "-NaN", "+nan", "NAN"):
        text = f"time,name,x\n0,a,1\n0,b,{word}\n1,{word},{word}\n"
        found = read_fast(text.encode(), HEADER, "name")
        assert found is not None
        assert_same(found, read_strict(text, "it", FORM))
        assert found.labels == ("a", "b", word)
