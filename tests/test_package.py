"""The package as a whole: its rooms and their order, cheap to import, with the promised names."""

import ast
import dataclasses
import inspect
import json
import re
import subprocess
import sys
import tomllib
from collections import Counter
from functools import cache
from pathlib import Path

import pytest
import yaml

import szlib
from szlib.workbook.cli import build_parser

PACKAGE = Path(szlib.__file__).parent
TESTS = Path(__file__).parent
ROOMS = [
    "core", "tracks", "encounters", "zones", "plaza", "control", "simulation", "workbook"
]  # fmt: skip
"""From the ground up: a room imports only from rooms before it."""
CASADI = "control"
DRAWN = {
    ("simulation.log", "workbook.figures.simulation"),
    ("zones.social_zone", "workbook.figures.zones"),
}
"""Methods that draw (`plot`, `animate`) import their figures when they are called; nothing else looks up."""

PUBLIC = [
    "ATC_SQUARE", "Area", "AttentionalSpace", "DataError", "DataWarning", "DifferentialDrive", "Ellipse",
    "EncounterSettings", "Recipe",
    "Extraction", "MEETINGS", "MPCCBF", "MPCSettings", "NullEncounters", "NullTest",
    "Person", "PlazaSettings", "ReferenceZone",
    "SCENARIOS",
    "Scenario", "SimulationLog", "SocialZone", "SolverError", "Square", "Step", "SzlibError", "Tracker",
    "ZoneError", "as_area", "ellipse_distance", "extract_days",
    "find_encounters", "find_pairs", "make_plaza", "minimum_enclosing_ellipse",
    "null_encounters", "null_pairs", "null_test", "of_kind", "read_tracks",
    "reference_zone", "remove_outliers",
    "rollouts", "segment_distance", "simulate", "time_shifted", "walked_area", "walls_from_map",
]  # fmt: skip
PROMISED = [
    "SocialZone.fit", "SocialZone.ellipse", "SocialZone.boundary", "SocialZone.save", "SocialZone.load",
    "SocialZone.table", "MPCCBF.step", "SimulationLog.metrics", "Extraction.samples",
    "PlazaSettings.true_zone",
]  # fmt: skip


MODULES = sorted(
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts)
    for path in PACKAGE.rglob("*.py")
    if path.name not in ("__init__.py", "__main__.py")
)


@cache
def source(module):
    return ast.parse(
        (PACKAGE / f"{module.replace('.', '/')}.py").read_text(encoding="utf-8")
    )


def nodes(tree, *, lazy=True, types=False):
    """Every node that runs, at import only if not lazy; those under TYPE_CHECKING if types."""
    for_types = (
        set()
        if types
        else {
            child
            for node in ast.walk(tree)
            if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
            for child in ast.walk(node)
        }
    )
    return [
        node
        for node in (ast.walk(tree) if lazy else tree.body)
        if node not in for_types
    ]


@cache
def imports(module, *, lazy=True, types=False):
    """What a module imports: modules (or rooms) of szlib, and other packages."""
    own, foreign = set(), set()
    for node in nodes(source(module), lazy=lazy, types=types):
        if isinstance(node, ast.Import):
            foreign |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            foreign.add((node.module or "").split(".")[0])
        elif isinstance(node, ast.ImportFrom):
            base = module.split(".")[: -node.level]
            base += node.module.split(".") if node.module else []
            for alias in node.names:
                found = ".".join([*base, alias.name])
                own.add(found if found in MODULES else ".".join(base))
    return own - {""}, foreign


def test_the_top_level_is_fixed():
    done = subprocess.run(
        ["git", "ls-files"], cwd=PACKAGE.parent, capture_output=True, text=True
    )
    if done.returncode:
        pytest.skip("this is no checkout")
    top = {name.split("/")[0] for name in done.stdout.splitlines()}
    assert {name for name in top if not name.startswith(".")} == {
        "CHANGELOG.md", "CITATION.cff", "Makefile", "README.md", "environment.lock", "notebooks",
        "pyproject.toml", "szlib", "tests",
    }  # fmt: skip


def test_the_version_is_the_same_everywhere():
    root = PACKAGE.parent
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))[
        "project"
    ]
    citation = (root / "CITATION.cff").read_text(encoding="utf-8")
    changes = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    assert project["version"] == szlib.__version__
    assert f"\nversion: {szlib.__version__}\n" in citation
    released = re.search(r"\n## (\S+) - (\d{4}-\d\d-\d\d)\n", changes)
    assert released is not None
    assert released.group(1) == szlib.__version__
    assert f"\ndate-released: {released.group(2)}\n" in citation


def test_names_of_test_modules_are_unique():
    """pytest imports test modules by their file name alone."""
    names = Counter(path.name for path in TESTS.rglob("test_*.py"))
    assert [name for name, count in names.items() if count > 1] == []


def test_no_test_module_imports_another():
    names = "|".join(["conftest", *(path.stem for path in TESTS.rglob("test_*.py"))])
    imported = re.compile(
        rf"^\s*(?:from|import) (?:[\w.]+\.)?(?:{names})\b", re.MULTILINE
    )
    wrong = [
        path.name
        for path in TESTS.rglob("*.py")
        if imported.search(path.read_text(encoding="utf-8"))
    ]
    assert wrong == [], "code that several test modules use belongs to tests/helpers"


# --- rooms -------------------------------------------------------------------------------------------


def room(module):
    return module.split(".")[0]


def test_every_module_is_in_a_room():
    assert {room(module) for module in MODULES} == set(ROOMS)


def test_a_room_imports_only_from_rooms_above_it():
    place = {name: number for number, name in enumerate(ROOMS)}
    imported = {(module, name) for module in MODULES for name in imports(module)[0]}
    assert {
        (a, b) for a, b in imported if place[room(b)] > place[room(a)]
    } - DRAWN == set()


def test_no_modules_import_each_other_in_a_circle():
    graph = {
        module: imports(module, types=True)[0] & set(MODULES) for module in MODULES
    }
    while outside := [
        module
        for module, names in graph.items()
        if not names & set(graph)
        or not any(module in names for names in graph.values())
    ]:
        graph = {
            module: names for module, names in graph.items() if module not in outside
        }
    assert {module: names & set(graph) for module, names in graph.items()} == {}


def test_each_library_has_its_room():
    for module in MODULES:
        foreign, at_import = imports(module)[1], imports(module, lazy=False)[1]
        assert "casadi" not in foreign or room(module) == CASADI, module
        assert "matplotlib" not in foreign or module.startswith("workbook."), module
        assert "matplotlib" not in at_import or module.startswith(
            "workbook.figures."
        ), module
        assert "sklearn" not in at_import, module
        assert "szlib" not in foreign, (
            f"{module}: relative, or the order above is not seen"
        )


def test_a_module_does_nothing_when_imported():
    for module in MODULES:
        tree = source(module)
        calls = [
            n
            for n in tree.body
            if isinstance(n, ast.Expr) and isinstance(n.value, ast.Call)
        ]
        assert calls == [], module
        assert not [node for node in ast.walk(tree) if isinstance(node, ast.Assert)], (
            module
        )


@pytest.mark.skipif(sys.platform != "linux", reason="counts threads in /proc")
def test_imports_start_no_threads():
    """Kernels are forked from a process with all imports; a pool of threads of Polars would stop there."""
    code = """if True:
        import os
        import pandas, polars, pyarrow, scipy.spatial, sklearn.neighbors, tqdm
        before = len(os.listdir("/proc/self/task"))
        import szlib.encounters.finding, szlib.tracks.readers, szlib.workbook.record
        print(len(os.listdir("/proc/self/task")) - before)"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "0\n", done.stderr


def test_the_tests_have_the_same_rooms():
    tests = Path(__file__).parent
    assert set(ROOMS) <= {path.name for path in tests.iterdir()}


# --- cheap to import ---------------------------------------------------------------------------------


def loaded_after(*codes):
    """Modules in memory after each of these codes, which run one after another in one new interpreter."""
    program = "".join(
        ["import sys\n", *(f"{code}\nprint(*sys.modules)\n" for code in codes)]
    )
    command = [sys.executable, "-c", program]
    lines = subprocess.run(
        command, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    return [set(line.split()) for line in lines]


def test_each_way_into_the_package_loads_only_what_it_needs():
    """Neither CasADi nor figures from tracks to zones, no figures for a robot, nothing heavy for the name."""
    szlib_alone, zones, robot = loaded_after(
        "import szlib",
        "szlib.read_tracks, szlib.find_encounters, szlib.SocialZone",
        "szlib.simulate, szlib.SCENARIOS, szlib.MPCCBF, szlib.rollouts",
    )
    heavy = {
        "casadi",
        "matplotlib",
        "sklearn",
        "scipy",
        "pandas",
        "polars",
        "numpy",
        "nbclient",
    }
    assert heavy.isdisjoint(szlib_alone)
    assert {"casadi", "matplotlib", "sklearn"}.isdisjoint(zones)
    assert "szlib.zones.social_zone" in zones
    assert {"matplotlib", "sklearn", "szlib.workbook"}.isdisjoint(robot)
    assert "szlib.control.controller" in robot


def test_a_robots_process_loads_no_tables_and_no_figures():
    """One step of each controller, in a fresh process."""
    (robot,) = loaded_after(
        "import szlib\n"
        "zone = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))\n"
        "people, walls = [[2.0, 0.3, -0.5, 0.0]], [[(-5.0, 2.0), (5.0, 2.0)]]\n"
        "edge = szlib.control.HalfPlane((0.0, -2.0), (0.0, 1.0))\n"
        "settings = szlib.MPCSettings.among_people()\n"
        "given = {'walls': walls, 'obstacles': [edge], 'settings': settings}\n"
        "point = szlib.MPCCBF(zone, **given)\n"
        "point.step((0, 0, 0, 0), (4, 0), people, ids=['a']).verify()\n"
        "wheels = szlib.DifferentialDrive(zone, **given)\n"
        "_ = wheels.step((0, 0, 0), (4, 0), people, ids=['a']).explain()"
    )
    assert "szlib.control.differential_drive" in robot and "casadi" in robot
    heavy = {"pandas", "polars", "sklearn", "pyarrow", "matplotlib", "scipy.stats"}
    assert heavy & robot == set()


def test_a_robot_needs_only_the_packages_of_a_plain_install():
    """Its controller, a zone that ships, and a map: nothing of the extra `data`."""
    (robot,) = loaded_after(
        "import szlib\n"
        "zone = szlib.reference_zone('grand-central-strangers')\n"
        "person, _ = szlib.Person((3.0, 0.5)), szlib.walls_from_map\n"
        "szlib.MPCCBF(zone).step((0, 0, 0, 0), (5, 0), [person])"
    )
    data = {"joblib", "polars", "pooch", "pyarrow", "sklearn", "threadpoolctl", "tqdm"}
    assert "casadi" in robot and data & robot == set()


@pytest.mark.slow
def test_what_kernels_are_forked_with_has_no_threads_of_polars():
    """A fork does not survive them: a notebook would wait for ever when it reads tracks."""
    from szlib.workbook.execution import PRELOADED

    (loaded,) = loaded_after(f"import {', '.join(PRELOADED)}")
    assert "matplotlib" in loaded and "polars" not in loaded


def test_the_command_line_loads_neither_numbers_nor_notebooks():
    (loaded,) = loaded_after(
        "from szlib.workbook.cli import build_parser; build_parser()"
    )
    assert {
        "numpy",
        "pandas",
        "matplotlib",
        "nbclient",
        "jupytext",
        "casadi",
    }.isdisjoint(loaded)


# --- names -------------------------------------------------------------------------------------------


def test_every_promised_name_is_there():
    for name in PUBLIC:
        assert name in dir(szlib)
        assert getattr(szlib, name) is not None
    with pytest.raises(AttributeError):
        _ = szlib.no_such_name


@pytest.mark.parametrize("name", PROMISED)
def test_every_promised_method_is_there(name):
    owner, method = name.split(".")
    assert callable(getattr(getattr(szlib, owner), method))


def test_every_scenario_is_there():
    assert set(szlib.SCENARIOS) >= {"passing", "corridor", "waiting", "making_room"}


def test_an_object_that_users_hold_cannot_be_changed():
    held = [
        value
        for name in szlib.__all__
        if dataclasses.is_dataclass(value := getattr(szlib, name))
    ]
    changeable = [
        value.__name__ for value in held if not value.__dataclass_params__.frozen
    ]
    assert len(held) > 20 and not changeable


def test_the_errors_are_one_family():
    assert issubclass(szlib.DataError, szlib.SzlibError)
    assert issubclass(szlib.DataError, ValueError)
    assert issubclass(szlib.ZoneError, szlib.SzlibError)
    assert issubclass(szlib.ZoneError, ValueError)
    assert issubclass(szlib.SolverError, szlib.SzlibError)
    assert issubclass(szlib.SolverError, RuntimeError)
    assert issubclass(szlib.DataWarning, UserWarning)


def test_the_keywords_of_the_paper_are_there():
    def parameters(function):
        return set(inspect.signature(function).parameters)

    assert {"area", "space", "min_speed"} <= parameters(szlib.EncounterSettings)
    assert {"fraction", "r_max"} <= parameters(szlib.remove_outliers)
    assert {"method", "r_max", "speeds"} <= parameters(szlib.SocialZone.fit)
    assert {"gamma", "N", "N_h", "dt", "pass_side"} <= parameters(szlib.MPCSettings)


def test_ready_made_environments_name_what_exists():
    """A container and Binder install versions of the lock, and a workflow calls commands that exist."""
    root = PACKAGE.parent
    container = json.loads((root / ".devcontainer" / "devcontainer.json").read_text())
    assert container["postCreateCommand"] == "make .venv/installed"
    assert "\nINSTALLED := $(VENV)/installed\n" in (root / "Makefile").read_text()
    pinned = (root / ".binder" / "requirements.txt").read_text().splitlines()[1:]
    lock = (root / "environment.lock").read_text()
    assert [each for each in pinned if f"\n{each} \\\n" not in f"\n{lock}"] == []
    names = {each.partition("==")[0] for each in pinned}
    assert {"jupyterlab", "anywidget", "polars", "casadi"} <= names
    assert not names & {"mujoco", "mypy", "playwright", "sphinx", "pytest", "mpmath"}
    workflow = yaml.safe_load(
        (root / "notebooks" / "examples" / "github_actions.yml").read_text()
    )
    commands = [
        step["run"] for step in workflow["jobs"]["zones"]["steps"] if "run" in step
    ]
    (run,) = [command for command in commands if "szlib" in command]
    options = build_parser().parse_args(run.split()[1:])
    assert (options.area, Path(options.out)) == ("auto", Path("../results").resolve())


def test_the_error_of_a_missing_package_names_the_extra():
    program = (
        "import sys; sys.modules['polars'] = None\n"
        "import szlib\n"
        "try:\n    szlib.SocialZone\n"
        "except ModuleNotFoundError as error:\n    print(error.name, error)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    expected = "polars szlib.SocialZone needs polars: pip install 'szlib[data]'\n"
    assert done.stdout == expected
