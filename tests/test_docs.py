"""The page of decisions and the README: commands and programs run, numbers are those of the tables."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import szlib
from szlib.workbook import cli
from szlib.zones import respect, verdict

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "notebooks" / "which_settings.md").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_page_of_decisions_links_files_and_names_what_exists():
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", PAGE):
        assert (ROOT / "notebooks" / target).exists(), target
    for name in re.findall(r"szlib\.(\w+)", PAGE):
        assert hasattr(szlib, name), name


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*fewer than 20 encounters:szlib.DataWarning")
def test_the_commands_and_programs_of_the_page_of_decisions_run(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    tracks = szlib.read_tracks(
        szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=400))
    )
    hall = tracks.assign(
        Frame=(25 * (tracks["t"] - tracks["t"].min())).round().astype(int)
    )
    hall = hall.assign(X=1000 * hall["x"], Y=1000 * hall["y"], Ped=hall["id"])
    columns = [
        "--columns",
        "frame=Frame,id=Ped,x=X,y=Y",
        "--frame-rate",
        "25",
        "--unit",
        "mm",
    ]
    hall[["Frame", "Ped", "X", "Y"]].to_csv("hall.csv", index=False)
    (tmp_path / "map.pgm").write_bytes(b"P5 10 10 255\n" + bytes(50) + b"\xfe" * 50)
    text = "image: map.pgm\nresolution: 0.1\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    (tmp_path / "map.yaml").write_text(text)
    for command in re.findall(r"```sh\nszlib (.*?)\n```", PAGE):
        given = command.split()
        assert cli.main(given if "--columns" in given else [*given, *columns]) == 0
    found = {
        "szlib": szlib,
        "zone": szlib.reference_zone("grand-central-strangers").ellipse,
    }
    for program in re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL):
        exec(compile(program, "which_settings.md", "exec"), found)
    assert len(found["walls"]) > 0
    assert "respect" in capsys.readouterr().out


def table(name):
    return pd.read_csv(ROOT / "notebooks" / "tables" / f"{name}.csv", comment="#")


def test_the_numbers_of_the_page_are_those_of_the_tables():
    text = " ".join(PAGE.split())
    radius = table("25_imposed").query("quantity == 'radius' and site != 'plaza'")
    squares = (radius["bias"] ** 2 + radius["scatter"] ** 2).groupby(
        [radius["method"], radius["encounters"]]
    )
    error = (100 * np.sqrt(squares.mean()))["respect"].map("{:.0f} cm".format)
    pairs = f"{error[150]} off (root mean square) with 150 encounters, {error[300]} with 300"
    assert f"{pairs}, {error[600]} with 600, {error[2400]} with 2,400" in text
    held = (
        100
        * radius.query("encounters >= 300")
        .groupby(["method", "encounters"])["held"]
        .mean()
    )
    low, high = held.groupby("method").min(), held.groupby("method").max()
    assert f"in {low['respect']:.0f} to {high['respect']:.0f} % of draws" in text
    assert f'"quantile" in {low["quantile"]:.0f} to {high["quantile"]:.0f} %' in text
    least = f"{respect.MIN_COMPARED} are the least for the zone that people keep; the paper's needs"
    assert f"{least} {verdict.MIN_TOTAL} lone encounters" in text

    sites = (
        table("06_sites")
        .query("min_distance == 1")
        .set_index(["site", "kinds"])["encounters"]
    )
    day = f"{sites['atc-1hz', 'all']} encounters, {sites['atc-1hz', 'strangers']} of them of strangers"
    assert (
        f"{day}; 80 minutes of Grand Central have {sites['grand-central', 'all']:,}"
        in text
    )

    day = table("25_sensitivity").query("data == 'ATC day' and method == 'quantile'")
    a = day.set_index(["parameter", "value"])["a"]
    default, strangers = a["default"].item(), a["kinds", "strangers"]
    assert (
        f"quantile zone is {default:.2f} m; it is {strangers:.2f} m for strangers"
        in text
    )
    assert f"{a['min_distance', '0.5']:.2f} m with `min_distance=0.5`" in text
    assert f"{a['duration', '4.0']:.2f} m with windows of 4 s" in text
    moved = (
        day[day["parameter"].isin(["r_max", "min_speed", "q"])]["a"]
        .sub(default)
        .abs()
        .max()
    )
    assert f"moved it by {100 * moved:.0f} cm at most" in text

    gamma = table("09_gamma").set_index("gamma")
    arrived, negative = (
        100 * gamma["arrived"],
        100 * gamma["worlds with h < 0"] / gamma["worlds"],
    )
    assert (
        f"arrived in {arrived[0.02]:.0f} % with 0.02, in {arrived[0.05]:.0f} to {arrived[0.1]:.0f} %"
        in text
    )
    assert f"with 0.4, {negative[0.4]:.0f} % of worlds had h < 0" in text
    reached = table("29_sensitivity").query("metric == 'reached'")
    assert set(reached["n"]) == {45}
    low, high = 100 * reached["mean"].min(), 100 * reached["mean"].max()
    assert f"left its arrival at {low:.0f} to {high:.0f} % of 45 walkers" in text
    walkers = table("29_walkers").query(
        "crowd == 'all recorded' and speed == '1 m/s' and metric == 'reached'"
    )
    ours = walkers.set_index("controller")
    assert set(ours["n"]) == {200}
    assert f"reached {100 * ours['mean']['among people']:.1f} % of goals" in text
    assert f"the defaults {100 * ours['mean']['MPC-CBF']:.1f} %" in text
    steps = (
        table("21_rollouts")
        .query("set == 'all'")
        .set_index("formulation")["infeasible_steps"]
    )
    assert (
        f"{steps['rest']:,} steps of 2,000 random worlds had none, of the defaults {steps['szlib']}"
        in text
    )


def test_the_five_results_are_those_of_the_tables():
    """Each number of the list is made anew from its table."""
    text = " ".join(README.split("## Five results")[1].split("\n## ")[0].split())
    blind = table("25_blind").set_index("crowd")
    plazas, ignoring = blind.loc["default plazas"], blind[blind["held_a"].isna()]
    held = f"in {plazas['held_a']:.0f} and {plazas['held_b']:.0f} of them"
    assert f"On {plazas['crowds']} plazas" in text and held in text
    assert f"({plazas['pairs']:,.0f} pairs each, median)" in text
    usable = f"to anybody {ignoring['usable'].sum()} are called"
    assert f"Of {ignoring['crowds'].sum()} crowds" in text and usable in text

    sites = table("06_sites").query("min_distance == 1 and kinds == 'strangers'")
    for site, words in (
        ("atc-1hz", "{} on a day of the ATC mall"),
        ("grand-central", "{} at Grand Central"),
    ):
        row = sites.set_index("site").loc[site]
        radius = f"{row['radius']:.2f} m ({row['radius_low']:.2f} to {row['radius_high']:.2f})"
        assert words.format(radius) in text
        assert f"{row['shifts']:.0f}" in text.split("smallest p that ")[1]
        assert row["p_value"] == pytest.approx(1 / (1 + row["shifts"]), abs=1e-5)

    ahead = table("25_claims").query(
        "data == 'ATC day' and claim == 'the zone reaches farther ahead than behind'"
    )
    assert ahead["verdict"].str.startswith("not decidable").all()
    respect = ahead.set_index("method").loc["respect, strangers"]
    assert f"{respect['n']} strangers meet head-on or cross, 150 are needed" in text
    assert "150 encounters of people who cross or come towards" in respect["verdict"]

    cells = table("28_matrix").set_index(["claim", "source", "condition"]).sort_index()
    in_front = cells.loc[
        (
            "The zone is larger in front of the person.",
            "ATC day, everybody",
            "the paper's",
        )
    ]
    held, draws = (int(in_front[name].sum()) for name in ("held", "draws"))
    assert f"in {held} of {draws} resamples of that day" in text
    stays = cells.loc["The robot remains within the safety set."].reset_index()
    papers, code = (
        stays[stays["condition"] == name]
        for name in ("the paper's", "weights and gamma of its code")
    )
    zones = papers.groupby("source")["draws"].max().sum()
    assert (papers["held"] == papers["draws"]).all() and code["held"].sum() == 0
    drawn = papers.groupby("source")["draws"].max()
    assert f"keeps out of all {zones} zones ({drawn['plazas']} plazas" in text
    assert f"{zones - drawn['plazas']} resamples) with our gamma, 0.05;" in text
    assert "with 0.4, that of the paper's code, of none" in text

    own_size = table("03_outliers").query("plazas == 6 and first_seed == 0")
    own_size = own_size.set_index(["intruders", "pace", "rule"])["error"]
    few, slow = own_size[0.0025, "rushing"], own_size[0.01, "slow"]
    rules = [f"0.2 %, {number} neighbours" for number in (20, 200)]
    off = "the zone is {:.0f} cm off with 20, {:.0f} cm with 200".format(
        *(100 * few[rule] for rule in rules)
    )
    assert off in text
    assert {f"{slow[rule]:.1f}" for rule in rules} == {"0.7"}
    assert "with 1 % slow ones 0.7 m with both" in text

    ours = (
        table("21_rollouts").query("set == 'all'").set_index("formulation").loc["szlib"]
    )
    below = [100 * ours[name] for name in ("share h < 0", "low h < 0", "high h < 0")]
    assert (
        f"In {ours['worlds']:,} random worlds h < 0 occurred in {{:.2f}} % ({{:.2f}} to {{:.2f}})".format(
            *below
        )
        in text
    )
    assert ours["unflagged_violations"] == 0 and "never after a step" in text
    walkers = (
        table("29_walkers")
        .query("crowd == 'all recorded' and speed == '1 m/s' and metric == 'reached'")
        .set_index("controller")
    )
    mean, low, high = (
        100 * walkers.loc["among people", name] for name in ("mean", "low", "high")
    )
    assert f"reached {mean:.1f} % of goals ({low:.1f} to {high:.1f})" in text
    assert f"`MPCSettings()` {100 * walkers.loc['MPC-CBF', 'mean']:.1f} %" in text
