"""The package as a whole: cheap to import, built from the ground up, and with the promised names."""

from __future__ import annotations

import ast
import importlib
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import szlib

PACKAGE = Path(szlib.__file__).parent
ORDER = [
    "errors", "funnels", "ellipses", "readers", "tracks", "encounters", "quality", "loaders", "outliers",
    "hulls", "zones", "truths", "plaza", "datasets", "nearby", "jobs", "extraction", "barriers", "settings",
    "distances", "meetings", "problem", "ipopt", "sqp", "mpc", "simulation", "scenarios", "worlds", "runs",
    "montecarlo", "comparisons", "plotting", "scenes", "charts", "pages", "commands", "workbook",
]  # fmt: skip
"""From the ground up: a module imports only from those before it."""
FIGURES = {"plotting", "scenes", "charts"}
MODULES = sorted(path.stem for path in PACKAGE.glob("*.py") if path.stem != "__init__")
PUBLIC = [
    "ATC_SQUARE", "AttentionalSpace", "DataError", "Ellipse", "MPCCBF", "MPCSettings", "SCENARIOS",
    "SocialZone", "SolverError", "SzlibError", "ZoneError", "ellipse_distance", "extract_days",
    "find_encounters",
    "minimum_enclosing_ellipse", "read_tracks", "remove_outliers", "rollouts", "segment_distance", "simulate",
]  # fmt: skip
PROMISED = [
    "SocialZone.fit", "SocialZone.ellipse", "SocialZone.boundary", "SocialZone.save", "SocialZone.load",
    "MPCCBF.step", "SimulationLog.metrics",
]  # fmt: skip


def imports(module: str, *, lazy: bool = True) -> set[str]:
    """What a module imports: names of szlib's modules with a dot before, and of other packages."""
    tree = ast.parse((PACKAGE / f"{module}.py").read_text(encoding="utf-8"))
    found = set()
    for node in ast.walk(tree) if lazy else tree.body:
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add((node.module or "").split(".")[0])
        elif isinstance(node, ast.ImportFrom):
            names = [node.module] if node.module else [alias.name for alias in node.names]
            found |= {f".{name}" for name in names if name and not name.startswith("__")}
    return found


def is_public(name: str) -> bool:
    return not name.startswith("_")


def is_stub(node: ast.FunctionDef | ast.ClassDef) -> bool:
    """A member of a Protocol, which the docstring of its class describes."""
    return ast.unparse(node.body[-1]) == "..."


# --- imports -----------------------------------------------------------------------------------------


def test_importing_szlib_loads_nothing_heavy() -> None:
    code = "import sys, szlib; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    heavy = {"casadi", "matplotlib", "sklearn", "scipy", "pandas", "polars", "numpy", "papermill"}
    assert heavy.isdisjoint(loaded)


def test_the_way_from_tracks_to_zones_loads_neither_casadi_nor_matplotlib() -> None:
    code = (
        "import sys, szlib; szlib.read_tracks, szlib.find_encounters, szlib.SocialZone; print(*sys.modules)"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert {"casadi", "matplotlib", "sklearn"}.isdisjoint(loaded)
    assert "szlib.zones" in loaded


def test_every_module_has_its_place() -> None:
    assert set(MODULES) <= set(ORDER), "name the new module in ORDER, above all that it imports"


@pytest.mark.parametrize("module", MODULES)
def test_imports_point_upwards(module: str) -> None:
    own = {name[1:] for name in imports(module) if name.startswith(".")}
    assert own <= set(ORDER[: ORDER.index(module)])


@pytest.mark.parametrize("module", MODULES)
def test_only_its_own_modules_import_casadi_figures_and_the_workbook(module: str) -> None:
    names = imports(module)
    assert "casadi" not in names or module in {"problem", "ipopt", "sqp"}
    assert ".workbook" not in names
    assert ".plotting" not in names or module in FIGURES
    assert "matplotlib" not in names or module in FIGURES | {"pages"}
    assert "matplotlib" not in imports(module, lazy=False) or module in FIGURES
    assert "sklearn" not in imports(module, lazy=False)
    assert "szlib" not in names  # relative, or the order above is not seen


@pytest.mark.parametrize("module", MODULES)
def test_modules_say_what_they_are_for_and_do_nothing_when_imported(module: str) -> None:
    tree = ast.parse((PACKAGE / f"{module}.py").read_text(encoding="utf-8"))
    assert ast.get_docstring(tree)
    calls = [node for node in tree.body if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)]
    assert calls == []
    assert not [node for node in ast.walk(tree) if isinstance(node, ast.Assert)]


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
    where = szlib if owner in dir(szlib) else importlib.import_module("szlib.scenarios")
    assert callable(getattr(getattr(where, owner), method))


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
    tree = ast.parse((PACKAGE / f"{module}.py").read_text(encoding="utf-8"))
    silent = []
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and is_public(node.name):
            members = node.body if isinstance(node, ast.ClassDef) else []
            methods = [m for m in members if isinstance(m, ast.FunctionDef) and is_public(m.name)]
            untold = [n for n in (node, *methods) if not ast.get_docstring(n) and not is_stub(n)]
            silent += [f"{node.name}: {n.name}" for n in untold]
    assert silent == []


def test_the_keywords_of_the_paper_are_there() -> None:
    def parameters(function: object) -> set[str]:
        return set(inspect.signature(function).parameters)

    assert {"square", "space"} <= parameters(szlib.find_encounters)
    assert {"fraction", "r_max"} <= parameters(szlib.remove_outliers)
    assert {"r_max", "outlier_fraction", "speeds"} <= parameters(szlib.SocialZone.fit)
    assert {"gamma", "N", "N_h", "dt", "pass_side"} <= parameters(szlib.MPCSettings)
