"""The cache of rows near an area: the same encounters without reading the day, never a damaged entry."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers.raw_days import make_raw_day, write_raw_day

import szlib
from szlib.encounters import blocks, near_rows_cache
from szlib.encounters.one_day import find_encounters_in_files
from szlib.files import CACHE, file_content
from szlib.tracks import funnels

pytestmark = pytest.mark.filterwarnings("ignore::szlib.DataWarning")  # one row is set aside
SPACE = szlib.AttentionalSpace(length=2.5, width=2.0)


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(CACHE, str(tmp_path / "cache"))
    return tmp_path / "cache" / "near-rows"


@pytest.fixture
def day(tmp_path: Path) -> Path:
    lines = write_raw_day(tmp_path / "day.csv", make_raw_day(1, wild=False)).read_text().splitlines()
    lines.insert(500, "1,2")  # a row that is set aside
    (tmp_path / "day.csv").write_text("\n".join(lines))
    return tmp_path / "day.csv"


def found(day: Path, **parameters: object) -> pd.DataFrame:
    """Encounters as `extract_days` finds them."""
    options = szlib.ReadOptions(max_gap=parameters.pop("max_gap", None))
    settings = szlib.EncounterSettings(**{"duration": 1.0, "space": SPACE, **parameters})
    return find_encounters_in_files([day], settings, options, [lambda: file_content(day)])


def same(ours: pd.DataFrame, theirs: pd.DataFrame) -> bool:
    pd.testing.assert_frame_equal(ours, theirs, check_exact=True)
    return len(ours) > 0 and funnels.get(ours) == funnels.get(theirs)


def entries(cache: Path) -> list[Path]:
    return sorted(cache.glob("*.parquet")) if cache.exists() else []


def test_other_conditions_use_the_cached_rows(
    cache: Path, day: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[dict] = [{}, {"min_speed": 0.2}, {"min_distance": 0.3}, {"space": szlib.AttentionalSpace()}]
    monkeypatch.setenv(CACHE, "off")
    fresh = [found(day, **conditions) for conditions in asked]
    assert not cache.exists(), "off is off"
    monkeypatch.setenv(CACHE, str(cache.parent))
    found(day)
    monkeypatch.setattr(blocks.UsableBlocks, "__iter__", None)  # the file is not read again
    again = [found(day, **conditions) for conditions in asked]
    for ours, theirs in zip(again[:3], fresh[:3], strict=True):
        assert same(ours, theirs)
    pd.testing.assert_frame_equal(again[3], fresh[3], check_exact=True)
    assert len(entries(cache)) == 1


def test_area_duration_gap_and_content_make_entries_of_their_own(cache: Path, day: Path) -> None:
    found(day)
    other_square = szlib.Square(x=(-17, -8), y=(-9, 8))
    for number, parameters in enumerate(({"area": other_square}, {"duration": 2.0}, {"max_gap": 0.3}), 2):
        found(day, **parameters)
        assert len(entries(cache)) == number
    changed = day.read_text().replace("1500.0", "1400.0", 1)
    day.write_text(changed)  # as long as before
    found(day)
    assert len(entries(cache)) == 5


@pytest.mark.parametrize("damage", ["one bit", "half", "nothing left", "no record", "the record of another"])
def test_damaged_entry_is_made_anew(cache: Path, day: Path, damage: str) -> None:
    fresh = found(day)
    (entry,) = entries(cache)
    record, content = entry.with_name(f"{entry.name}.json"), entry.read_bytes()
    stored = record.read_bytes()
    if damage == "no record":
        record.unlink()
    elif damage == "the record of another":
        record.write_bytes(stored.replace(b'"version": 2', b'"version": 0'))
    else:
        middle = len(content) // 2
        flipped = content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]
        entry.write_bytes({"one bit": flipped, "half": content[:middle], "nothing left": b""}[damage])
    assert same(found(day), fresh)
    assert (entry.read_bytes(), record.read_bytes()) == (content, stored)


def test_entries_unused_for_longest_are_removed(
    cache: Path, day: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found(day, duration=1.0)
    (first,) = entries(cache)
    found(day, duration=2.0)
    (second,) = set(entries(cache)) - {first}
    for path, age in ((first, 2), (second, 1)):
        near_rows_cache.os.utime(path, (1e9 - age, 1e9 - age))
    found(day, duration=1.0)  # now the second one is older
    monkeypatch.setattr(near_rows_cache, "LIMIT", 2 * first.stat().st_size + 5000)
    found(day, duration=0.5)
    assert first in entries(cache)
    assert second not in entries(cache)
    near_rows_cache.clear()
    assert entries(cache) == []


def test_unwritable_cache_warns_and_the_search_goes_on(cache: Path, day: Path) -> None:
    cache.parent.write_text("a file where the folder should be")
    with pytest.warns(RuntimeWarning, match="rows near the area are not cached"):
        assert len(found(day)) > 0


def test_numbers_round_trip_bit_for_bit(cache: Path) -> None:
    rng = np.random.default_rng(0)
    odd = np.array([-0.0, 0.1 + 0.2, 1e-300, -2.5e15, 7.0])
    for t, x in ((1351038629 + rng.integers(0, 10**7, 5) / 1000, odd), (odd, np.arange(5.0))):
        rows = blocks.FileRows(t, np.array([1.0, 1, 2, 3, 5e9]), x, rng.normal(size=5))
        summary = blocks.FileSummary(9, 2.5, first_fault=(3, "ragged"))
        near_rows_cache.store((5, "ab"), {"which": str(t)}, rows, summary)
        back, seen = near_rows_cache.load(5, {"which": str(t)}, lambda: (5, "ab")) or (None, None)
        assert seen == summary
        for ours, theirs in zip(rows, back, strict=True):
            assert ours.tobytes() == theirs.tobytes()


def test_two_threads_can_store_the_same_entry(cache: Path, day: Path) -> None:
    fresh = found(day)
    near_rows_cache.clear()
    with ThreadPoolExecutor(2) as two:  # each entry is written whole: tests/test_files.py has processes
        for ours in two.map(found, [day] * 4):
            assert same(ours, fresh)
    assert len(entries(cache)) == 1
