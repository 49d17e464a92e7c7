"""The process of an answer: it holds the learner's function and the cases, and nothing of the judges.

    python -I answer_program.py FOLDER MODULE ...    (the judges start it)

FOLDER holds szlib; each MODULE is a part of szlib that the answer may use, or "szlib" for all of it. The program
forks for each answer. The fork limits its time and memory; it cannot open other files than those of Python and
its packages, start processes or threads, or import szlib and the judges. What it writes is one line of JSON for
each call, and stands for nothing more than the result of that call. This keeps cheating out; it is no prison.
"""

from __future__ import annotations

import ast
import base64
import contextlib
import importlib
import json
import os
import pickle
import struct
import symtable
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

import cloudpickle  # type: ignore[import-untyped]
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

# before the first answer, which may need them; matplotlib makes a folder when it is imported
LOADED = (cloudpickle, pd, plt)
MEMORY = 6 * 2**30  # of the address space [bytes]
LARGEST = 1_000_000  # numbers of a result
DENIED = (
    "subprocess.", "os.fork", "os.exec", "os.posix_spawn", "os.spawn", "os.system", "os.kill", "os.startfile",
    "os.remove", "os.rename", "os.rmdir", "os.mkdir", "os.chmod", "os.chown", "os.link", "os.symlink",
    "os.truncate", "os.putenv", "pty.", "shutil.", "socket.", "ctypes.", "gc.", "signal.", "sqlite3.", "ftplib.",
    "urllib.", "sys.addaudithook", "cpython.run_", "syslog.", "fcntl.", "mmap.", "resource.prlimit",
)  # fmt: skip


def load(folder: str, modules: tuple[str, ...]) -> None:
    """Import the modules of szlib, and put their names into a module `szlib` that has nothing else."""
    sys.path.insert(0, folder)
    judges, qp = ModuleType("judges"), ModuleType("judges.qp")
    code = Path(__file__).with_name("qp.py").read_text(encoding="utf-8")
    exec(compile(code, "judges/qp.py", "exec"), qp.__dict__)
    vars(judges).update(__path__=[], __getattr__=refuse)
    vars(judges)["qp"], sys.modules["judges"], sys.modules["judges.qp"] = qp, judges, qp
    if "szlib" in modules:
        szlib = importlib.import_module("szlib")
        for name in szlib.__all__:
            getattr(szlib, name)
    elif modules:
        szlib = ModuleType("szlib")
        for name in modules:
            found = importlib.import_module(name)
            public = (each for each in vars(found).values() if getattr(each, "__module__", "") == name)
            vars(szlib).update((each.__name__, each) for each in public)
        for name in [name for name in sys.modules if name.partition(".")[0] == "szlib"]:
            del sys.modules[name]
        vars(szlib)["__getattr__"] = refuse
        sys.modules["szlib"] = szlib
        sys.modules.update((name, szlib) for name in modules)
    sys.path.remove(folder)
    sys.path[:] = [entry for entry in sys.path if Path(entry).resolve() != Path(folder).resolve()]


def refuse(name: str) -> NoReturn:
    """Stand for what a part of szlib does not have."""
    if name.startswith("__"):
        raise AttributeError(name)
    raise ImportError(f"no answer: this uses szlib's or the judges' {name}; the task is to write it yourself")


def guard(folder: str, modules: tuple[str, ...], leave: Callable[[str], None]) -> None:
    """Limit what the process may do from now on; `leave(text)` ends it.

    An audit hook cannot be removed. It calls nothing that an answer could replace: no function of Python's
    library that is written in Python, and no method of an object of the answer.
    """
    is_open, denied = "szlib" in modules, DENIED
    package = f"{folder}{os.sep}szlib{os.sep}"
    libraries = [*sys.path, "/usr/share/zoneinfo"]
    roots = tuple(each.rstrip(os.sep) + os.sep for each in libraries if each.strip(os.sep))
    writes = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_TRUNC
    closed = ("_posixsubprocess",) if is_open else ("_posixsubprocess", "szlib", "judges")
    starts_with, devnull = str.startswith, os.devnull

    class Finder:
        """Say that closed modules are not there."""

        @staticmethod
        def find_spec(name: str, path: Any = None, target: Any = None) -> None:
            if name.partition(".")[0] in closed:
                raise ImportError(f"no answer: this uses {name}; the task is to write it yourself")

    def is_readable(path: Any) -> bool:
        if type(path) is not str or ".." in path:
            return False
        is_own = starts_with(path, package)
        return is_open if is_own else path == devnull or starts_with(path, roots)

    def hook(event: str, args: tuple[Any, ...]) -> None:
        if event == "open":
            path, _, flags = args
            if type(path) is int:
                return
            if type(path) is bytes:
                path = path.decode()
            if (flags or 0) & writes and path != devnull:
                leave("no answer: your function writes a file")
            elif not is_readable(path):
                leave("no answer: your function reads a file")
        elif event == "_thread.start_new_thread" and not is_open:
            leave("no answer: your function starts a thread")
        elif starts_with(event, denied) and not (is_open and starts_with(event, ("ctypes.", "gc.", "mmap."))):
            leave("no answer: your function calls " + event)

    sys.dont_write_bytecode = True
    sys.modules.pop("_posixsubprocess", None)
    if subprocess := sys.modules.get("subprocess"):
        vars(subprocess).update(_fork_exec=None, _posixsubprocess=None)
    sys.meta_path.insert(0, Finder)
    sys.addaudithook(hook)


def limit(seconds: float) -> None:
    """Limit the time and the memory of the process, where the system has limits."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(1, 9)  # the end of the program is the end of its forks
    with contextlib.suppress(ImportError):
        import resource

        for name, most in (
            ("RLIMIT_CPU", int(seconds) + 5),
            ("RLIMIT_AS", MEMORY),
            ("RLIMIT_CORE", 0),
        ):
            with contextlib.suppress(ValueError, OSError):
                resource.setrlimit(getattr(resource, name), (most, most))


def define(given: dict[str, str]) -> Callable[..., Any]:
    """The learner's function: unpickled, or defined by the statements of its source that it needs."""
    if "pickle" in given:
        loaded: Callable[..., Any] = pickle.loads(base64.b64decode(given["pickle"]))
        return loaded
    name = given["name"]
    failure: BaseException = NotImplementedError(f"the sheet defines no {name}")
    space: dict[str, Any] = {"__name__": "sheet"}
    for statement in find_needed(given["source"], name):
        try:
            exec(compile(ast.Module([statement], []), "sheet", "exec"), space)
        except (Exception, SystemExit) as error:
            failure = error  # if the function is defined, it says what it misses when it runs
    if name not in space:
        raise failure
    found: Callable[..., Any] = space[name]
    if not callable(found):
        raise NotImplementedError(f"{name} is a {type(found).__name__}; expected a function")
    return found


def find_needed(source: str, name: str) -> list[ast.stmt]:
    """The statements that define or change `name`, and the names of the sheet that it uses, in order.

    Other statements, such as experiments, figures and checks, can neither fail, take time nor read files.
    """
    statements = ast.parse(source).body
    tables = [symtable.symtable(ast.unparse(each), "sheet", "exec") for each in statements]
    symbols = [symbol for table in tables for symbol in table.get_symbols()]
    imported = {symbol.get_name() for symbol in symbols if symbol.is_imported()}
    parts = [
        (statement, find_defined(table) | (find_changed(statement) - imported), find_used(table))
        for statement, table in zip(statements, tables, strict=True)
    ]
    needed, n_before = {name, "*"}, 0
    while len(needed) > n_before:
        n_before = len(needed)
        for _, defined, used in parts:
            if defined & needed:
                needed |= used
    return [statement for statement, defined, _ in parts if defined & needed]


def find_defined(table: symtable.SymbolTable) -> set[str]:
    """The names that a statement assigns, imports, or defines as a function or a class."""
    symbols = table.get_symbols()
    return {symbol.get_name() for symbol in symbols if symbol.is_assigned() or symbol.is_imported()}


def find_changed(statement: ast.stmt) -> set[str]:
    """The names whose objects a statement changes: `a[0] = 1`, `a.x = 1`, `a.append(1)`; "*" for all names."""
    if isinstance(statement, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
        return set()
    found = set()
    for node in ast.walk(statement):
        match node:
            case ast.alias(name="*"):
                found.add("*")
            case ast.Attribute(ctx=ast.Store()) | ast.Subscript(ctx=ast.Store()):
                found.add(find_base(node))
            case ast.Expr(value=ast.Call(func=ast.Attribute() as method)):
                found.add(find_base(method))
    return found


def find_base(node: ast.expr) -> str:
    """The name before the dots and brackets of an expression; "" if there is none."""
    while isinstance(node, (ast.Attribute, ast.Subscript)):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""


def find_used(table: symtable.SymbolTable) -> set[str]:
    """The names of the sheet that a statement uses, also in its functions."""
    used = {symbol.get_name() for symbol in table.get_symbols() if symbol.is_global()}
    return used.union(*map(find_used, table.get_children()))


def encode(got: Any) -> dict[str, Any]:
    """The result as a dictionary for JSON."""
    kind = type(got).__name__
    if got is None:
        return {"refused": "your function returns None: does it end with `return`?"}
    if isinstance(got, str):
        return {"text": str(got)[:200]}
    if kind == "Ellipse":
        numbers = [np.asarray(each, float).tolist() for each in (got.center, got.semi_axes, got.angle)]
        return {"ellipse": numbers}
    try:
        array = np.asarray(got)
    except ValueError:
        return {"type": kind, "is_uneven": True}
    if array.dtype.kind not in "biuf":
        return {"type": kind}
    if array.size > LARGEST:
        return {"refused": f"your result has {array.size} numbers; at most {LARGEST} are expected"}
    array = array.astype(float) if array.dtype.kind == "f" else array
    return {
        "numbers": array.ravel().tolist(),
        "kind": array.dtype.kind,
        "shape": list(array.shape),
    }


def read_exactly(n: int, read: Callable[[int, int], bytes] = os.read) -> bytes:
    """The next n bytes of the judge."""
    parts = []
    while n:
        part = read(0, min(n, 2**20))
        if not part:
            os._exit(0)
        parts.append(part)
        n -= len(part)
    return b"".join(parts)


def receive() -> Any:
    """The next value that the judge sends."""
    return pickle.loads(read_exactly(struct.unpack(">Q", read_exactly(8))[0]))


def answer(given: dict[str, Any], folder: str, modules: tuple[str, ...]) -> NoReturn:
    """Define the function, and answer every call until the judge sends None."""
    write, leave_process, mark, take = os.write, os._exit, given["mark"], receive

    def say(found: dict[str, Any]) -> None:
        data = json.dumps({**found, "mark": mark}).encode() + b"\n"
        while data:
            data = data[write(1, data) :]

    def leave(text: str) -> None:
        try:
            write(1, b'{"mark": "%s", "refused": "%s"}\n' % (mark.encode(), text.encode()))
        finally:
            leave_process(0)

    limit(given["seconds"])
    guard(folder, modules, leave)
    sys.stdout = sys.stderr = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115
    function: Callable[..., Any] = encode
    failure: BaseException | None = None
    try:
        function = define(given)
    except BaseException as error:
        failure = error
    while (arguments := take()) is not None:
        try:
            if failure is not None:
                raise failure
            found = encode(function(*arguments))
        except MemoryError:
            leave("your function took more memory than it may")
        except BaseException as error:
            text = str(error)[:300]
            is_closed = isinstance(error, ImportError) and text.startswith("no answer")
            found = {"refused": text} if is_closed else {"error": type(error).__name__, "text": text}
        say(found)
    leave_process(0)


def main(folder: str, *modules: str) -> None:
    """Serve answers, one after the other."""
    load(folder, modules)
    os.write(1, b"ready\n")
    while True:
        given = receive()
        if not isinstance(given, dict):
            continue  # it was meant for an answer that ended its process
        child = os.fork() if hasattr(os, "fork") else 0
        if not child:
            answer(given, folder, modules)
        os.waitpid(child, 0)
        os.write(1, f"end {given['mark']}\n".encode())


if __name__ == "__main__":
    main(*sys.argv[1:])
