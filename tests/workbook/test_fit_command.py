"""`szlib fit`: from extracted days, or tracks, to a zone with its table, verdict and figure."""

import pytest
from helpers.faulty_disk import FaultyDisk

import szlib
from szlib.workbook import fit_command
from szlib.workbook.cli import main


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A day with enough encounters for a zone, and its extraction beside it, in `days`."""
    folder = tmp_path_factory.mktemp("recording")
    plaza = szlib.PlazaSettings(n_encounters=700, date="2012-10-24")
    path = szlib.make_plaza(folder / "atc-20121024.csv", settings=plaza)
    szlib.extract_days(path, out=folder / "days", progress=False)
    return path


@pytest.fixture(scope="module")
def expected(recording):
    """The zone of the recording by the library."""
    return szlib.SocialZone.from_tracks(szlib.read_tracks(recording))


@pytest.fixture(autouse=True)
def few_shifts(monkeypatch):
    """Fewer shifts of the null model than a user gets: the most expensive part of `szlib fit`."""
    monkeypatch.setattr(fit_command, "N_RESAMPLES", 20)
    monkeypatch.setattr("szlib.workbook.record.data_cache.NULL_SHIFTS", 3)


def fit(*arguments):
    return main(["fit", *map(str, arguments)])


@pytest.mark.slow
def test_zone_from_tracks_is_that_of_the_library(recording, expected, tmp_path, capsys):
    out = tmp_path / "zone.json"
    assert fit(recording, "--out", out) == 0
    printed, zone = capsys.readouterr().out, szlib.SocialZone.load(out)
    assert printed.startswith("method respect: the zone that people keep, with 95 %")
    assert zone.ellipses == expected.ellipses
    assert zone.null_test == expected.null_test and zone.null_test is not None
    assert printed.splitlines()[-1] == f"zone at 1.1 m/s: {zone.verdict(1.1).sentence}"
    rows = [line.split() for line in printed.splitlines()[2:8]]
    assert [float(row[0]) for row in rows] == list(zone.ellipses)
    assert [float(row[1]) for row in rows] == [
        round(e.semi_axes[0], 2) for e in zone.ellipses.values()
    ]
    assert {" ".join(row[10:]) for row in rows} == {
        str(zone.verdict(speed)) for speed in zone.ellipses
    }
    assert (tmp_path / "zone.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
@pytest.mark.filterwarnings("always::szlib.DataWarning")
@pytest.mark.parametrize("method", ["respect", "paper"])
def test_rejected_rows_are_told_and_move_no_zone(
    recording, expected, tmp_path, capsys, method
):
    lines = recording.read_text().splitlines()
    for k in range(50, len(lines), 100):  # one field is missing in 1 % of the rows
        lines[k] = ",".join(lines[k].split(",")[:-1])
    damaged = tmp_path / "atc-20121024.csv"
    damaged.write_text("\n".join(lines) + "\n")
    zones = {"respect": expected}
    for file in (damaged,) if method in zones else (damaged, recording):
        assert fit(file, "--out", tmp_path / "zone.json", "--method", method) == 0
        zones[file] = szlib.SocialZone.load(tmp_path / "zone.json")
    whole = zones.get(method) or zones[recording]
    ellipses = (zone.ellipses[1.1] for zone in (whole, zones[damaged]))
    sizes = [[*each.center, *each.semi_axes] for each in ellipses]
    rows = f"{len(range(50, len(lines), 100))} x missing or extra fields"
    assert f"rejected rows: {rows}" in capsys.readouterr().err
    assert sizes[1] == pytest.approx(sizes[0], abs=0.03)


@pytest.mark.slow
def test_columns_of_other_names_and_units_are_read(recording, tmp_path):
    tracks = szlib.read_tracks(recording)[["t", "id", "x", "y"]]
    tracks[["x", "y"]] *= 100
    tracks.set_axis(["Zeit", "Person", "Ost", "Nord"], axis=1).to_csv(
        tmp_path / "hall.csv", index=False
    )
    out, columns = tmp_path / "zone.json", "t=Zeit,id=Person,x=Ost,y=Nord"
    given = [
        "--columns",
        columns,
        "--unit",
        "cm",
        "--area",
        *map(float, str(szlib.ATC_SQUARE).split()),
    ]
    assert fit(tmp_path / "hall.csv", "--out", out, "--method", "paper", *given) == 0
    zone, expected = (
        szlib.SocialZone.load(out),
        szlib.find_encounters(szlib.read_tracks(recording)),
    )
    assert zone.provenance["encounters"] == expected["encounter"].nunique()


@pytest.mark.slow
def test_extracted_days_have_no_null_model_until_their_tracks_are_given(
    recording, tmp_path, capsys
):
    days, out = recording.with_name("days"), tmp_path / "zone.json"
    assert fit(days, "--out", out, "--method", "paper") == 0
    assert szlib.SocialZone.load(out).null_test is None
    printed = capsys.readouterr().out
    assert "no null model: extracted days hold no tracks; add --tracks FILE" in printed
    assert fit(days, "--out", out, "--method", "paper", "--tracks", recording) == 0
    zone = szlib.SocialZone.load(out)
    assert zone.null_test is not None and zone.null_test.n_shifts == 3
    assert "no null model" not in capsys.readouterr().out


@pytest.mark.slow
def test_kinds_are_those_of_the_library(recording, tmp_path):
    days, out = recording.with_name("days"), tmp_path / "zone.json"
    assert fit(days, "--out", out, "--kind", "opposite", "crossing") == 0
    samples = szlib.Extraction.load(days).samples()
    expected = szlib.SocialZone.fit(
        szlib.of_kind(samples, ["opposite", "crossing"]), n_resamples=20
    )
    assert szlib.SocialZone.load(out).ellipses == expected.ellipses


@pytest.mark.slow
def test_a_file_that_is_two_days_of_a_folder_is_refused(tmp_path, capsys):
    tracks = szlib.read_tracks(szlib.make_plaza(tmp_path / "plaza.csv"))
    tracks["t"] -= tracks["t"].min()
    folders = tmp_path / "one", tmp_path / "two"
    for k, folder in enumerate(folders):
        folder.mkdir()
        moved = tracks.assign(x=tracks["x"] + k)[["t", "id", "x", "y"]]
        moved.to_csv(folder / "hall.csv", index=False)
    given = {"out": tmp_path / "days", "area": szlib.ATC_SQUARE, "progress": False}
    szlib.extract_days(folders[1], **given)
    szlib.extract_days(folders, **given)
    capsys.readouterr()
    assert fit(tmp_path / "days", "--out", tmp_path / "zone.json") != 0
    assert "two of its days are one file" in capsys.readouterr().err


def test_excluded_day_is_not_fitted(recording, tmp_path, capsys):
    arguments = [
        recording.with_name("days"),
        "--out",
        tmp_path / "zone.json",
        "--exclude",
        "2012-10-24",
    ]
    assert fit(*arguments) == 2
    assert (
        "no day is left; expected one besides those excluded, ['2012-10-24']"
        in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["{days}", "--method", "respect"],
            "method respect needs a null model; no null model",
        ),
        (["{days}", "--kind", "friends"], "unknown kinds ['friends']"),
        (
            ["{days}", "--out", "{day}"],
            "atc-20121024.csv: expected a file that ends in .json",
        ),
        (
            ["{days}", "--out", "{folder}/other.json"],
            "other.json: exists, and is no zone of szlib",
        ),
        (["{days}", "--out", "{folder}/plan.json"], "plan.png: exists, and is no zone"),
        (
            ["{days}", "--out", "{folder}/nowhere/zone.json"],
            "nowhere: is no folder that can be written",
        ),
        (
            ["{days}", "--out", "{day}/zone.json"],
            "atc-20121024.csv: is no folder that can be written",
        ),
        (
            ["{days}", "{day}"],
            "atc-20121024.csv: give one folder of extracted days, or files of tracks",
        ),
        (
            ["{days}", "--tracks", "{other}"],
            "other.csv: is none of the files of the extracted days",
        ),
        (
            ["{day}", "--tracks", "{day}"],
            "--tracks and --exclude belong to a folder of extracted days",
        ),
        (["{missing}"], "missing.csv: no such file"),
        (["{other}", "--method", "papr"], "method must be one of paper, hull"),
        (
            ["{day}", "--exclude", "2012-10-24"],
            "--tracks and --exclude belong to a folder of extracted days",
        ),
    ],
)
def test_what_cannot_be_fitted_is_refused_at_once(
    recording,
    tmp_path,
    capsys,
    arguments,
    message,
):
    (tmp_path / "other.json").write_text("{}")
    (tmp_path / "plan.png").write_bytes(b"a map of the hall")
    (tmp_path / "other.csv").write_text("t,id,x,y\n0,1,0,0\n")
    names = {
        "days": recording.with_name("days"), "day": recording, "folder": tmp_path,
        "other": tmp_path / "other.csv", "missing": tmp_path / "missing.csv",
    }  # fmt: skip
    before = recording.read_bytes()
    given = [text.format_map(names) for text in arguments]
    assert fit("--out", tmp_path / "zone.json", *given) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert recording.read_bytes() == before and not (tmp_path / "zone.json").exists()


def test_too_few_encounters_are_said_with_what_is_missing(tmp_path, capsys):
    day = szlib.make_plaza(
        tmp_path / "few.csv", settings=szlib.PlazaSettings(n_encounters=1)
    )
    assert fit(day, "--out", tmp_path / "zone.json") == 2
    assert (
        "no two people who come towards each other or cross came within 2 m"
        in capsys.readouterr().err
    )
    assert fit(day, "--out", tmp_path / "zone.json", "--method", "paper") == 2
    assert "encounters were found, 600 are needed" in capsys.readouterr().err
    assert not (tmp_path / "zone.json").exists()


def test_damaged_day_is_named(recording, tmp_path, capsys):
    szlib.extract_days(recording, out=tmp_path / "days", progress=False)
    file = tmp_path / "days" / "2012-10-24.parquet"
    file.write_bytes(file.read_bytes()[:-9])
    assert fit(tmp_path / "days", "--out", tmp_path / "zone.json") == 2
    assert (
        "2012-10-24.parquet: is not the result of this extraction"
        in capsys.readouterr().err
    )


@pytest.mark.slow
def test_a_full_disk_leaves_the_earlier_zone(recording, tmp_path, capsys):
    days, out = recording.with_name("days"), tmp_path / "zone.json"
    assert fit(days, "--out", out) == 0
    before = out.read_bytes()
    with FaultyDisk(failing=0):
        assert fit(days, "--out", out, "--kind", "strangers") == 2
    assert "cannot write the zone" in capsys.readouterr().err
    assert out.read_bytes() == before
