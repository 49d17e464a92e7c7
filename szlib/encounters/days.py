"""Many days to encounters: a Parquet file and a funnel for each, resumable, on one machine or many.

In the folder `out` each day leaves ``<day>.parquet``, its samples, and then ``<day>.json``, its record: the
funnel, every parameter, and a key made of these and of the content of the day's files.  Both are written
as a whole or not at all, the record last.  A day whose record has the right key, and whose samples have
the right SHA-256, is not computed again; so a run that was stopped or killed goes on where it was.
"""

from __future__ import annotations

import time
import warnings
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import joblib
import pandas as pd
from tqdm import tqdm

from ..errors import DataError, DataWarning, SzlibError
from ..files import claim_folder, printable
from ..parallel import run_tasks
from ..tracks import datasets, funnels
from ..tracks.recordings import find_day, name_recordings
from .geometry import Area
from .one_day import Chain, contents, day_key, finished_record, write_record

PURPOSE = "encounters by day"
"""What the folder of an extraction is marked as."""
_READ = "read all files"
"""The first stage of the funnel of many days."""


@dataclass(frozen=True, eq=False)
class Extraction:
    """What `extract_days` has done.

    Parameters
    ----------
    out : folder of the results.
    table : one row a day: day, status ("done" now, "kept" from before, "excluded", "failed"), files, rows
        read, unusable rows among them, encounters, samples, seconds, and why a day failed.
    exclude : days that were left out.
    keys : of each finished day, the name of its result: content, parameters and version.
    area : where encounters were looked for, in every day; None where the files of no day have one.
    """

    out: Path
    table: pd.DataFrame
    exclude: tuple[str, ...] = ()
    keys: Mapping[str, str] = field(default_factory=dict)
    area: Area | None = None

    @property
    def failed(self) -> pd.DataFrame:
        """The days that failed, and why."""
        return self.table[self.table["status"] == "failed"]

    def samples(self) -> pd.DataFrame:
        """Samples of all finished days, as from `szlib.find_encounters`, by day, encounters numbered anew.

        The funnels of all days are added up, stage by stage.
        Independent of the order of the files, of what was kept, and of who computed it.  Where recordings
        of several files have one day in common, their names tell them apart.  Raises DataError where no day
        was finished, or another run has since left something else in the folder.
        """
        days = self.table.loc[self.table["status"].isin(["done", "kept"]), "day"]
        if len(days) == 0:
            raise DataError(f"no day was finished in {self.out}; see the table: {self}")
        parts, stages, count = [], [], 0
        for day in sorted(days):
            if finished_record(self.out, day, self.keys.get(day, "")) is None:
                raise DataError(
                    f"{self.out / day}.parquet: is no longer what this extraction has left there (another "
                    "run, other data or parameters, or damage); extract again, into a folder of its own"
                )
            part = pd.read_parquet(self.out / f"{day}.parquet")
            stages.append(
                [s | {"stage": _READ} if s["stage"].startswith("read ") else s for s in funnels.get(part)]
            )
            part = part[~part["day"].isin(self.exclude)]
            numbers, found = pd.factorize(part["encounter"])
            parts.append(part.assign(encounter=numbers + count, day=part["day"].astype(str), file=day))
            count += len(found)
        shared = Counter(name for part in parts for name in part["day"].unique())
        for k, part in enumerate(parts):
            twice = part["day"].map(shared) > 1
            parts[k] = part.assign(day=part["day"].where(~twice, part["day"] + " (" + part["file"] + ")"))
        parts = [part.drop(columns="file") for part in parts]
        samples = pd.concat([part for part in parts if len(part)] or parts[:1], ignore_index=True)
        return funnels.attach(samples.astype({"day": "category"}), funnels.add(stages))

    def __str__(self) -> str:
        shown = self.table.to_string(index=False, float_format="{:.1f}".format)
        counts = self.table["status"].value_counts().sort_index()
        told = ", ".join(f"{n} {status}" for status, n in counts.items())
        return f"{shown}\n{told}" + (f"; area: {self.area}" if self.area else "")


def extract_days(
    paths: str | Path | Sequence[str | Path],
    *,
    out: str | Path,
    n_jobs: int = 1,
    exclude: Iterable[str] = (),
    progress: bool = True,
    **parameters: Any,
) -> Extraction:
    """Find the encounters of many days, each on its own, and keep them in a folder.

    Parameters
    ----------
    paths : files, folders or globs.  Files that begin on the same calendar day make one day (the pieces
        of the 1 Hz day); a recording that counts frames, has its own days, or whose clock does not count from
        1970, is one by its file's name (and folder's, where two are called the same).
    out : folder of the results, its own; made if it is missing.
    n_jobs : number of processes; -1: one for each core. See `szlib.parallel.run_tasks`.
    exclude : days "YYYY-MM-DD" to leave out, as event days were in the paper (sec. 2); they are not read.
    progress : whether to show a bar over the days.
    parameters : of `szlib.read_tracks` and `szlib.find_encounters`: square, space, duration, min_distance,
        min_speed, throughout, file_format, unit, frame_rate, columns, max_gap, tz.  Without
        a square the ATC mall's files have `ATC_SQUARE`, others "auto": the `szlib.walked_area` of the first
        day, the same for all.

    Of a raw day the rows near the square, some 2 % of the file, are kept in the user's cache, so that other
    conditions are asked of them without reading it again (`szlib.encounters.near_rows_cache`):
    $SZLIB_CACHE names the folder, or is "off".

    Returns
    -------
    An `Extraction`: its table says what became of each day; a day that fails does not stop the others.

    Raises
    ------
    DataError : there is no such file or parameter.
    StorageError : the folder cannot be made, holds what szlib did not write, or data that is to be read.
    """
    unknown = sorted(set(parameters) - set(Chain.__dataclass_fields__))
    if unknown:
        raise DataError(f"unknown parameter {unknown}; expected some of {list(Chain.__dataclass_fields__)}")
    chain, folder = Chain(**parameters), Path(out)
    excluded = (exclude,) if isinstance(exclude, str) else tuple(sorted(map(str, exclude)))
    files = sorted({file.resolve() for file in datasets.find(paths)})
    claim_folder(folder, PURPOSE, inputs=files)
    days = _by_day(files, chain)
    chain = _settled(chain, [files for day, files in sorted(days.items()) if day not in excluded])
    rows = [_row(day, files, status="excluded") for day, files in days.items() if day in excluded]
    tasks = [
        joblib.delayed(extract_day)(day, files, str(folder.resolve()), chain)
        for day, files in sorted(days.items())
        if day not in excluded
    ]
    with tqdm(total=len(tasks), unit="day", disable=not progress) as bar:
        for row in run_tasks(tasks, n_jobs=n_jobs):
            rows.append(row)
            bar.update()
            bar.set_postfix_str(f"{row['day']} {row['status']}")
    keys = {row["day"]: row.pop("key") for row in rows}
    table = pd.DataFrame(rows).sort_values("day", ignore_index=True)
    return Extraction(folder, table, excluded, keys, chain.square if isinstance(chain.square, Area) else None)


def _by_day(files: Sequence[Path], chain: Chain) -> dict[str, list[str]]:
    """The files of each day, or of each recording that has no calendar day."""
    days: dict[str, list[str]] = {}
    for file, name in zip(files, name_recordings(files), strict=True):
        days.setdefault(find_day(file, chain.read_options) or printable(name), []).append(str(file))
    return days


def _settled(chain: Chain, days: Iterable[Sequence[str]]) -> Chain:
    """The parameters with the area of the first day that has one."""
    for files in days:
        with suppress(SzlibError):  # computing that day will tell why
            return chain.settled([Path(file) for file in files])
    return chain


def extract_day(day: str, files: Sequence[str], out: str, chain: Chain) -> dict[str, Any]:
    """Compute one day, or keep it if it is there; its row of the table.  Nothing but `out` is shared."""
    begun = time.perf_counter()
    row, folder = _row(day, files, status="failed"), Path(out)
    try:
        with contents(files) as content:
            record, status = None, "done"
            if (folder / f"{day}.json").is_file():
                record = finished_record(folder, day, day_key(files, content, chain))
                status = "kept" if record else "done"
            if record is None:
                with warnings.catch_warnings():  # the table and the funnel tell of rows set aside
                    warnings.simplefilter("ignore", DataWarning)
                    samples = chain.encounters([Path(file) for file in files], content)
                record = write_record(folder, day, day_key(files, content, chain), samples, files, chain)
        row |= {name: record[name] for name in ("key", "rows", "unusable", "encounters", "samples")}
        row["status"] = status
    except SzlibError as error:
        row["why"] = printable(error)
    except Exception as error:  # whatever is wrong with one day, the others go on
        row["why"] = printable(f"{type(error).__name__}: {error}")
    return row | {"seconds": time.perf_counter() - begun}


def _row(day: str, files: Sequence[str], status: str) -> dict[str, Any]:
    counts = dict.fromkeys(("rows", "unusable", "encounters", "samples"), 0)
    return {"day": day, "status": status, "files": len(files), **counts, "seconds": 0.0, "why": "", "key": ""}
