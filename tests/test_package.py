"""The package as a whole: its rooms and their order, cheap to import, with the promised names."""

from __future__ import annotations

import ast
import importlib
import inspect
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

import szlib

PACKAGE = Path(szlib.__file__).parent
GROUND = ["errors", "files", "memory", "parallel"]
ROOMS = {
    "tracks": [
        "funnels", "formats", "plausible", "readers", "clock", "quality", "interop", "sites", "datasets",
    ],
    "tracks.formats": ["frame_rates", "plain", "foreign", "layouts", "tables", "rows"],
    "encounters": [
        "geometry", "areas", "kinds", "search", "streaming", "pipeline", "days", "shifting", "null",
    ],
    "encounters.streaming": ["blocks", "cells", "kept_rows", "reading"],
    "encounters.search": ["occupants", "windows", "samples", "nearby", "finding"],
    "zones": [
        "costmap", "ellipses", "outliers", "by_direction", "hulls", "respect", "uncertainty", "zone_file",
        "social_zone",
    ],
    "zones.by_direction": ["radii", "quantile"],
    "zones.respect": ["presence", "boundary", "significance", "estimate"],
    "plaza": ["truth", "people", "scores", "indifferent"],
    "control": [
        "barriers", "settings", "distances", "people", "problem", "step", "solvers", "mpc",
        "differential",
    ],
    "control.people": ["person", "tracker", "meetings"],
    "control.step": ["scene", "report", "decision", "polygon"],
    "control.solvers": ["compiled", "ipopt", "program", "sqp", "sizes", "ladder"],
    "simulation": [
        "scenario", "crowds", "controllers", "metrics", "log", "closed_loop", "scenarios", "rollouts",
        "comparisons",
    ],
    "simulation.crowds": [
        "walkers", "orca", "social_force", "speed_model", "reacting", "replay", "promises", "scores",
    ],
    "simulation.controllers": ["protocol", "baselines"],
    "simulation.metrics": ["endings", "motion", "manners", "social"],
    "simulation.scenarios": ["paper", "meetings", "worlds", "atlas"],
    "workbook": [
        "figures", "claims", "sensitivity", "exercises", "record", "laboratory", "report", "runner",
        "command_line",
    ],
    "workbook.figures": [
        "style", "tracks", "encounters", "zones", "control", "players", "simulation", "comparisons",
        "crowds",
    ],
    "workbook.exercises": [
        "task", "tracks", "outliers", "zones", "certainty", "barriers", "robot", "checking",
    ],
    "workbook.command_line": ["endings", "commands", "options", "entry"],
    "workbook.record": ["method", "places", "validation", "tables", "notebook"],
    "workbook.laboratory": ["bench", "page"],
    "workbook.report": ["front_page", "document"],
    "workbook.runner": ["summary", "kernels", "worker", "execution"],
}  # fmt: skip
"""From the ground up: a room imports only from rooms before it, a file only from files before it."""
MOST_FILES, LONGEST = 9, 300
CASADI = {
    "control.problem", "control.solvers.compiled", "control.solvers.ipopt", "control.solvers.program"
}  # fmt: skip
HANDED_OVER = {("simulation.log", "workbook.figures.simulation")}
"""What a log draws of itself, it asks of the workbook when it is called; nothing else looks up."""

PUBLIC = [
    "ATC_SQUARE", "AttentionalSpace", "DataError", "DataWarning", "DifferentialDrive", "Ellipse",
    "Extraction", "Grid", "MEETINGS", "MPCCBF", "MPCSettings", "NullEncounters", "NullTest",
    "PairCorrelation", "Person", "PlazaSettings", "Presence", "Region", "Respect", "SCENARIOS",
    "Scenario", "SimulationLog", "SocialZone", "SolverError", "Square", "Step", "SzlibError", "Tracker",
    "ZoneError", "as_area", "ellipse_distance", "encounter_kinds", "extract_days", "find_encounters",
    "fit_respect", "indifferent_crowd", "make_plaza", "minimum_enclosing_ellipse", "null_encounters",
    "null_test", "of_kind", "pair_correlation", "read_tracks", "remove_outliers", "respect_boundary",
    "respect_radius", "rollouts", "segment_distance", "simulate", "time_shifted", "walked_area",
]  # fmt: skip
PROMISED = [
    "SocialZone.fit", "SocialZone.ellipse", "SocialZone.boundary", "SocialZone.save", "SocialZone.load",
    "SocialZone.table", "MPCCBF.step", "SimulationLog.metrics", "Extraction.samples",
    "PlazaSettings.true_zone",
]  # fmt: skip


def _order() -> list[str]:
    """Every module, from the ground up."""
    files = list(GROUND)
    for room, names in ROOMS.items():
        if "." in room:
            continue
        for name in names:
            inner = ROOMS.get(f"{room}.{name}")
            files += [f"{room}.{name}.{each}" for each in inner] if inner else [f"{room}.{name}"]
    return files


ORDER = _order()
MODULES = sorted(
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts)
    for path in PACKAGE.rglob("*.py")
    if path.name != "__init__.py"
)


def source(module: str) -> ast.Module:
    return ast.parse((PACKAGE / f"{module.replace('.', '/')}.py").read_text(encoding="utf-8"))


def nodes(tree: ast.Module, *, lazy: bool = True) -> list[ast.AST]:
    """Every node that runs: what stands under TYPE_CHECKING does not; at import only, if not lazy."""
    for_types = {
        child
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for child in ast.walk(node)
    }
    return [node for node in (ast.walk(tree) if lazy else tree.body) if node not in for_types]


def imports(module: str, *, lazy: bool = True) -> tuple[set[str], set[str]]:
    """What a module imports: modules (or rooms) of szlib, and other packages."""
    own, foreign = set(), set()
    for node in nodes(source(module), lazy=lazy):
        if isinstance(node, ast.Import):
            foreign |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            foreign.add((node.module or "").split(".")[0])
        elif isinstance(node, ast.ImportFrom):
            base = module.split(".")[: -node.level]
            base += node.module.split(".") if node.module else []
            for alias in node.names:
                found = ".".join([*base, alias.name])
                own.add(found if found in {*MODULES, *ROOMS} else ".".join(base))
    return own - {""}, foreign


def is_public(name: str) -> bool:
    return not name.startswith("_")


def test_the_top_level_is_fixed() -> None:
    done = subprocess.run(["git", "ls-files"], cwd=PACKAGE.parent, capture_output=True, text=True)
    if done.returncode:
        pytest.skip("this is no checkout")
    top = {name.split("/")[0] for name in done.stdout.splitlines()}
    assert {name for name in top if not name.startswith(".")} == {
        "CHANGELOG.md", "CITATION.cff", "Makefile", "README.md", "environment.lock", "notebooks",
        "pyproject.toml", "szlib", "tests",
    }  # fmt: skip


def test_no_two_test_files_have_one_name() -> None:
    """They are imported by it, and so is conftest, from any folder."""
    names = Counter(path.name for path in (PACKAGE.parent / "tests").rglob("*.py"))
    assert [name for name, count in names.items() if count > 1 and name != "__main__.py"] == []


# --- rooms -------------------------------------------------------------------------------------------


def test_every_file_has_its_place_in_a_room() -> None:
    assert set(MODULES) == set(ORDER), "name the new module in ROOMS, after all that it imports"
    assert {path.name for path in PACKAGE.iterdir() if path.is_dir() and path.name != "__pycache__"} == {
        room for room in ROOMS if "." not in room
    }


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_is_small_and_its_door_says_what_is_in_it(room: str) -> None:
    assert len(ROOMS[room]) <= MOST_FILES
    door = ast.parse((PACKAGE / room.replace(".", "/") / "__init__.py").read_text(encoding="utf-8"))
    told = [line.split()[0] for line in (ast.get_docstring(door) or "").splitlines()[2:] if line]
    assert told == ROOMS[room], "one line for each file, in their order"
    assert len(door.body) == 3, "a docstring and the lazy names, nothing else"


@pytest.mark.parametrize("module", MODULES)
def test_a_file_is_one_idea(module: str) -> None:
    lines = (PACKAGE / f"{module.replace('.', '/')}.py").read_text(encoding="utf-8").count("\n")
    assert lines <= LONGEST


@pytest.mark.parametrize("module", MODULES)
def test_imports_point_upwards(module: str) -> None:
    before = set(ORDER[: ORDER.index(module)])
    wrong = {
        name
        for name in imports(module)[0]
        if not (name in before or {m for m in MODULES if m.startswith(f"{name}.")} <= before)
    }
    assert {name for name in wrong if (module, name) not in HANDED_OVER} == set()


@pytest.mark.parametrize("module", MODULES)
def test_each_library_has_its_room(module: str) -> None:
    foreign, at_import = imports(module)[1], imports(module, lazy=False)[1]
    assert "casadi" not in foreign or module in CASADI
    assert "matplotlib" not in foreign or module.startswith("workbook.")
    assert "matplotlib" not in at_import or module.startswith("workbook.figures.")
    assert "sklearn" not in at_import
    assert "szlib" not in foreign  # relative, or the order above is not seen


@pytest.mark.parametrize("module", MODULES)
def test_modules_say_what_they_are_for_and_do_nothing_when_imported(module: str) -> None:
    tree = source(module)
    assert ast.get_docstring(tree)
    calls = [node for node in tree.body if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)]
    assert calls == []
    assert not [node for node in ast.walk(tree) if isinstance(node, ast.Assert)]


def test_the_tests_have_the_same_rooms() -> None:
    tests = Path(__file__).parent
    assert {room for room in ROOMS if "." not in room} <= {path.name for path in tests.iterdir()}


# --- cheap to import ---------------------------------------------------------------------------------


def loaded_after(code: str) -> set[str]:
    """Modules in memory once this code has run in an interpreter of its own."""
    command = [sys.executable, "-c", f"{code}; import sys; print(*sys.modules)"]
    return set(subprocess.run(command, capture_output=True, text=True, check=True).stdout.split())


def test_importing_szlib_loads_nothing_heavy() -> None:
    heavy = {"casadi", "matplotlib", "sklearn", "scipy", "pandas", "polars", "numpy", "papermill"}
    assert heavy.isdisjoint(loaded_after("import szlib"))


def test_the_way_from_tracks_to_zones_loads_neither_casadi_nor_matplotlib() -> None:
    loaded = loaded_after("import szlib; szlib.read_tracks, szlib.find_encounters, szlib.SocialZone")
    assert {"casadi", "matplotlib", "sklearn"}.isdisjoint(loaded)
    assert "szlib.zones.social_zone" in loaded


def test_the_way_to_a_robot_loads_no_figures() -> None:
    loaded = loaded_after("import szlib; szlib.simulate, szlib.SCENARIOS, szlib.MPCCBF, szlib.rollouts")
    assert {"matplotlib", "sklearn", "szlib.workbook"}.isdisjoint(loaded)


def test_the_command_line_loads_neither_numbers_nor_notebooks() -> None:
    loaded = loaded_after("from szlib.workbook.command_line.options import parser; parser()")
    assert {"numpy", "pandas", "matplotlib", "papermill", "jupytext", "casadi"}.isdisjoint(loaded)


# --- names -------------------------------------------------------------------------------------------


def test_every_promised_name_is_there() -> None:
    for name in PUBLIC:
        assert name in dir(szlib)
        assert getattr(szlib, name) is not None
    with pytest.raises(AttributeError):
        _ = szlib.no_such_name


@pytest.mark.parametrize("name", PROMISED)
def test_every_promised_method_is_there(name: str) -> None:
    owner, method = name.split(".")
    assert callable(getattr(getattr(szlib, owner), method))


@pytest.mark.parametrize(
    "old", ["tracks.read_tracks", "montecarlo", "meetings", "nearby", "plotting", "records"]
)
def test_no_old_dotted_path_lives_on(old: str) -> None:
    with pytest.raises(ImportError):
        importlib.import_module(f"szlib.{old}")


def test_every_scenario_is_there() -> None:
    assert set(szlib.SCENARIOS) == {"passing", "corridor", "waiting", "making_room"}


def test_the_errors_are_one_family() -> None:
    assert issubclass(szlib.DataError, szlib.SzlibError)
    assert issubclass(szlib.DataError, ValueError)
    assert issubclass(szlib.ZoneError, szlib.SzlibError)
    assert issubclass(szlib.ZoneError, ValueError)
    assert issubclass(szlib.SolverError, szlib.SzlibError)
    assert issubclass(szlib.SolverError, RuntimeError)
    assert issubclass(szlib.DataWarning, UserWarning)


@pytest.mark.parametrize("module", MODULES)
def test_every_public_function_says_what_it_does(module: str) -> None:
    silent = []
    for node in ast.walk(source(module)):  # functions within functions, too: their name alone must be guessed
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and is_public(node.name):
            silent += [] if ast.get_docstring(node) else [f"{node.name}, line {node.lineno}"]
    assert silent == []


def test_the_keywords_of_the_paper_are_there() -> None:
    def parameters(function: object) -> set[str]:
        return set(inspect.signature(function).parameters)

    assert {"square", "space"} <= parameters(szlib.find_encounters)
    assert {"fraction", "r_max"} <= parameters(szlib.remove_outliers)
    assert {"r_max", "outlier_fraction", "speeds"} <= parameters(szlib.SocialZone.fit)
    assert {"gamma", "N", "N_h", "dt", "pass_side"} <= parameters(szlib.MPCSettings)
