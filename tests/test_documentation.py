"""Documentation: every parameter is described, every example runs, every exported name has an example."""

import ast
import dataclasses
import doctest
import importlib
import inspect
import re
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

import szlib
from szlib.control import obstacles

PACKAGE = Path(szlib.__file__).parent
SECTION = re.compile(r"^(\w[\w ]*)\n-{3,}$", re.MULTILINE)
ENTRY = re.compile(r"^(\*{0,2}\w+(?:, \*{0,2}\w+)*) :(?: |$)", re.MULTILINE)
QUOTED = re.compile(r"(`+)(.+?)\1", re.DOTALL)


def module_names():
    for path in sorted(PACKAGE.rglob("*.py")):
        if path.name != "__main__.py":
            parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
            yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
    for path in sorted((PACKAGE.parent / "notebooks" / "plots").glob("[!_]*.py")):
        yield f"plots.{path.stem}"
    yield from ("costmaps", "studies.imposed_zone", "studies.pooling")


MODULES = list(module_names())


def fail_with(problems):
    if problems:
        pytest.fail("\n".join(problems), pytrace=False)


# --- parameters --------------------------------------------------------------------------------------


def sections(docstring):
    """The text of each underlined section."""
    parts = SECTION.split(docstring)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def entries(docstring, *names):
    """The names that have an entry in one of these sections."""
    text = "\n".join(sections(docstring).get(name, "") for name in names)
    return {
        name.strip(" *")
        for match in ENTRY.finditer(text)
        for name in match[1].split(",")
    }


def quoted(docstring):
    """Every word in backticks."""
    return {
        word
        for match in QUOTED.finditer(docstring)
        for word in re.findall(r"\w+", match[2])
    }


def parameters(function):
    names = inspect.signature(function).parameters
    return {
        name
        for name in names
        if name not in ("self", "cls") and not name.startswith("_")
    }


def constructor_parameters(kind):
    """Parameters of a class; none where the constructor is not written in szlib."""
    if dataclasses.is_dataclass(kind) or hasattr(kind, "_fields"):
        return parameters(kind)
    written = next((base for base in kind.__mro__ if "__init__" in vars(base)), object)
    is_ours = written.__module__.startswith("szlib") and not getattr(
        kind, "_is_protocol", False
    )
    return parameters(kind) if is_ours else set()


def attributes(kind):
    """Names of a class's attributes, also of those that its methods set."""
    names = set(dir(kind))
    for base in kind.__mro__:
        names |= set(getattr(base, "__annotations__", ()))
        if base.__module__.startswith("szlib"):
            names |= set(re.findall(r"self\.(\w+)", inspect.getsource(base)))
    return names


def described(module):
    """Name, docstring, parameters and attributes of each public function, class and method of a module."""
    members = vars(importlib.import_module(module))
    for name, found in members.items():
        if name.startswith("_") or getattr(found, "__module__", None) != module:
            continue
        if inspect.isclass(found):
            text = f"{inspect.getdoc(found) or ''}\n{vars(found).get('__init__', object).__doc__ or ''}"
            yield name, text, constructor_parameters(found), attributes(found)
            for method, value in vars(found).items():
                called = (
                    value.__func__
                    if isinstance(value, classmethod | staticmethod)
                    else value
                )
                if not method.startswith("_") and inspect.isfunction(called):
                    text = inspect.getdoc(getattr(found, method)) or ""
                    for owner, other in re.findall(r"`(\w+)\.(\w+)`", text):
                        # parameters as of a method of the same module
                        base = getattr(members.get(owner), other, None)
                        text += f"\n{inspect.getdoc(base)}"
                    yield f"{name}.{method}", text, parameters(called), set()
        elif inspect.isfunction(inspect.unwrap(found) if callable(found) else found):
            yield name, inspect.getdoc(found) or "", parameters(found), set()


def test_every_parameter_is_described():
    """An entry under Parameters (or Attributes), or its name in backticks; no entry for what is not there."""
    problems = []
    for module in MODULES:
        for name, docstring, given, fields in described(module):
            known = entries(docstring, "Parameters", "Attributes", "Other Parameters")
            missing = given - known - quoted(docstring)
            stray = (
                entries(docstring, "Parameters", "Other Parameters", "Attributes")
                - given
                - fields
            )
            problems += [
                f"{module}.{name}: {each} is not described" for each in sorted(missing)
            ]
            problems += [
                f"{module}.{name}: {each} is described, but is no parameter"
                for each in sorted(stray)
            ]
    fail_with(problems)


def test_everything_public_has_a_docstring():
    """Functions within functions as well."""
    silent = []
    for module in MODULES:
        tree = ast.parse(
            Path(importlib.import_module(module).__file__ or "").read_text(
                encoding="utf-8"
            )
        )
        silent += [] if ast.get_docstring(tree) else [module]
        for node in ast.walk(tree):
            if isinstance(
                node, ast.FunctionDef | ast.ClassDef
            ) and not node.name.startswith("_"):
                silent += (
                    []
                    if ast.get_docstring(node)
                    else [f"{module}: {node.name}, line {node.lineno}"]
                )
    assert silent == []


# --- examples ----------------------------------------------------------------------------------------


def examples(module):
    """The examples of a module's docstrings; `szlib` and `np` are there without an import."""
    finder = doctest.DocTestFinder(exclude_empty=True)
    names = {"szlib": szlib, "np": np}
    return [
        each
        for each in finder.find(importlib.import_module(module), extraglobs=names)
        if each.examples
    ]


LONG = "szlib.zones.social_zone"  # its examples fit zones


@pytest.mark.parametrize(
    "module",
    [
        pytest.param(each, marks=pytest.mark.slow) if each == LONG else each
        for each in MODULES
    ],
)
def test_every_example_runs(module, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # a class of an example must not take the place of one of another test
    monkeypatch.setattr(obstacles, "_KINDS", obstacles._KINDS.copy())
    matplotlib.use("Agg")
    runner = doctest.DocTestRunner(
        optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS, verbose=False
    )
    report = []
    for example in examples(module):
        runner.run(example, out=report.append)
        plt.close("all")
    assert not report, "".join(report)


def test_every_exported_name_has_an_example():
    """A section in its docstring; a constant is used in an example of its module or another one."""
    text, problems = (
        "\n".join(path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py")),
        [],
    )
    for name in sorted(szlib.__all__):
        found = getattr(szlib, name)
        if inspect.isclass(found) or inspect.isfunction(found):
            examples = sections(inspect.getdoc(found) or "").get("Examples", "")
            problems += [] if ">>>" in examples else [f"{name} has no Examples"]
        elif not inspect.ismodule(found):
            used = re.search(
                rf"^\s*(?:>>>|\.\.\.) .*\bszlib\.{name}\b", text, re.MULTILINE
            )
            problems += [] if used else [f"szlib.{name} is used in no example"]
    fail_with(problems)
