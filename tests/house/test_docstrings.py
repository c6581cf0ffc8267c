"""Docstrings of all that is public say what every argument and every result is; read from the sources, nothing imported.

Public is every function, class and method without a leading underscore in a module and class without one. Commands are apart:
their arguments are documented by their help. What a method overrides may be documented where it is first written.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
ROOMS = ("haptics", "firmware_models", "rigs")
COMMANDS = (
    "haptics/cli/",
    "rigs/commands.py",
    "firmware_models/simulate.py",
    "rigs/tolerance/command.py",
    "rigs/garments/command.py",
)
Function = ast.FunctionDef | ast.AsyncFunctionDef
_FIELD = re.compile(r":(?:param|ivar|arg)\s+([\w, *]+):")


def documented(text: str) -> set[str]:
    """Names that a docstring documents; ``:param a, b:`` documents both."""
    return {name.strip(" *") for found in _FIELD.findall(text) for name in found.split(",")}


def parameters(function: Function, method: bool) -> list[str]:
    """Names of the arguments that a caller gives."""
    made = function.args
    names = [one.arg for one in (*made.posonlyargs, *made.args)][1 if method else 0 :]
    names += [one.arg for one in (made.vararg, *made.kwonlyargs, made.kwarg) if one is not None]
    return [name for name in names if not name.startswith("_")]


def decorators(node: Function | ast.ClassDef) -> set[str]:
    """Last words of a node's decorators: ``property``, ``setter``, ``staticmethod``, ``overload``."""
    found = (one.func if isinstance(one, ast.Call) else one for one in node.decorator_list)
    return {one.attr if isinstance(one, ast.Attribute) else one.id for one in found if isinstance(one, ast.Attribute | ast.Name)}


def gives_something(function: Function) -> bool:
    """Whether a result is announced that is not None."""
    return function.returns is not None and not (isinstance(function.returns, ast.Constant) and function.returns.value is None)


def faults_of_function(function: Function, where: str, inherited: set[str], in_class: str | None) -> Iterator[str]:
    """What is missing from one function's docstring; ``in_class``: the class's own docstring, for its ``__init__``."""
    marks = decorators(function)
    if "overload" in marks or "setter" in marks or "override" in marks:
        return
    text = ast.get_docstring(function) or ""
    if function.name == "__init__":
        text = f"{text}\n{in_class or ''}"
    elif not text:
        if function.name not in inherited:
            yield f"{where}: no docstring"
        return
    method = in_class is not None and "staticmethod" not in marks
    missing = [name for name in parameters(function, method) if name not in documented(text)]
    if missing:
        yield f"{where}: no word on {', '.join(missing)}"
    says = re.search(r":returns?:|:yields?:", text)
    if gives_something(function) and function.name != "__init__" and not says and not marks & {"property", "cached_property"}:
        yield f"{where}: no word on what it returns"


def fields_of(cls: ast.ClassDef) -> list[str]:
    """Fields of a dataclass or model that are set by whoever makes one."""
    return [
        one.target.id
        for one in cls.body
        if isinstance(one, ast.AnnAssign)
        and isinstance(one.target, ast.Name)
        and not one.target.id.startswith("_")
        and "ClassVar" not in ast.unparse(one.annotation)
    ]


def documented_below(cls: ast.ClassDef) -> set[str]:
    """Fields that have a string under them, or a description of their own."""
    found = set[str]()
    for one, after in zip(cls.body, [*cls.body[1:], None], strict=True):
        if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name):
            below = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) and isinstance(after.value.value, str)
            described = one.value is not None and (
                "description=" in ast.unparse(one.value) or "parameter(" in ast.unparse(one.value)
            )
            found |= {one.target.id} if below or described else set()
    return found


def faults_of_class(cls: ast.ClassDef, where: str, inherited: set[str]) -> Iterator[str]:
    """What is missing from a class, its fields and its public methods."""
    text = ast.get_docstring(cls) or ""
    if not text:
        yield f"{where}: no docstring"
    marks, bases = decorators(cls), {ast.unparse(base).split("[")[0].rpartition(".")[2] for base in cls.bases}
    if "dataclass" in marks or bases & {"NamedTuple", "BaseModel", "_Part", "TypedDict"}:
        known = documented(text) | documented_below(cls)
        missing = [name for name in fields_of(cls) if name not in known]
        if missing:
            yield f"{where}: no word on its fields {', '.join(missing)}"
    for node in cls.body:
        if isinstance(node, Function) and (not node.name.startswith("_") or node.name == "__init__"):
            yield from faults_of_function(node, f"{where}.{node.name}", inherited if cls.bases else set(), text)


def faults_of(path: Path, inherited: set[str]) -> list[str]:
    """What is missing in one file."""
    tree, name = ast.parse(path.read_text(encoding="utf-8")), path.relative_to(CHECKOUT).as_posix()
    found = [] if ast.get_docstring(tree) else [f"{name}: no docstring"]
    if name.startswith(COMMANDS):
        return found
    for node in tree.body:
        if isinstance(node, Function | ast.ClassDef) and not node.name.startswith("_"):
            where = f"{name}:{node.lineno} {node.name}"
            faults = (
                faults_of_class(node, where, inherited)
                if isinstance(node, ast.ClassDef)
                else faults_of_function(node, where, set(), None)
            )
            found += faults
    return found


def sources() -> list[Path]:
    """Every public module of the product."""
    found = (path for room in ROOMS for path in sorted((CHECKOUT / room).rglob("*.py")))
    return [path for path in found if not any(part.startswith("_") and part != "__init__.py" for part in path.parts)]


def documented_methods() -> set[str]:
    """Names of methods that some class documents: one that overrides such a method need not say it again."""
    trees = (ast.parse(path.read_text(encoding="utf-8")) for path in sources())
    classes = (node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.ClassDef))
    return {one.name for cls in classes for one in cls.body if isinstance(one, Function) and ast.get_docstring(one)}


@pytest.fixture(scope="module")
def inherited() -> set[str]:
    return documented_methods()


@pytest.mark.parametrize("folder", sorted({path.parent.relative_to(CHECKOUT).as_posix() for path in sources()}))
def test_everything_public_is_documented(folder: str, inherited: set[str]) -> None:
    faults = [fault for path in sources() if path.parent == CHECKOUT / folder for fault in faults_of(path, inherited)]
    assert not faults, "\n" + "\n".join(faults)
