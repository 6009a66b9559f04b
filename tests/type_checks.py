"""Checks of types and array shapes while the tests run: beartype and jaxtyping, but not in every call.

After a module of the package was imported, its functions and methods are replaced by checked ones. In each
test the first calls of a function are checked, and later a sample of them: a loop over frames calls the same
functions with the same types again and again, and checking each of these calls takes longer than the tests
themselves. A check is only compiled when its function is called. See ADR 26.
"""

import functools
import importlib.machinery
import inspect
import sys
from collections.abc import Callable, Generator, Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import FunctionType, ModuleType
from typing import Any, get_type_hints

from beartype import beartype
from jaxtyping import jaxtyped

PACKAGE = "manytouch"
FIRST_CALLS = 20  # of each function, in the first tests that call it
FIRST_CALLS_AGAIN = 5  # in each later test
EVERY = 100  # of the later calls


class _Test:
    """The test that runs."""

    number = 0


def begin_test() -> None:
    """Check the first calls of each function again."""
    _Test.number += 1


def check(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function that checks the arguments and the result of some of the calls of another one."""
    checked: Callable[..., Any] | None = None
    test = calls = total = first = 0

    @functools.wraps(function)
    def call(*arguments: Any, **named: Any) -> Any:
        nonlocal checked, test, calls, total, first
        __tracebackhide__ = True
        if test != _Test.number:
            test, calls = _Test.number, 0
            first = FIRST_CALLS if total < FIRST_CALLS else FIRST_CALLS_AGAIN
        calls += 1
        if calls > first and calls % EVERY:
            return function(*arguments, **named)
        total += 1
        if checked is None:
            checked = _compiled(function)
        if inspect.isgeneratorfunction(function):
            return _in_contexts(checked(*arguments, **named))
        with jaxtyped("context"):  # in which the name of a dimension has one value
            return checked(*arguments, **named)

    return call


def _in_contexts(generator: Generator[Any, None, Any]) -> Generator[Any, None, Any]:
    """A generator whose arguments are checked at the first value, in a context of its own."""
    while True:
        with jaxtyped("context"):
            try:
                value = next(generator)
            except StopIteration as end:
                return end.value
        yield value


def _compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function with a check of its arguments and its result, to be called in a context of jaxtyping."""
    try:
        get_type_hints(function)
    except (NameError, TypeError):  # types that only mypy knows, which jaxtyping leaves out
        return jaxtyped(function, typechecker=beartype)
    return beartype(function)


def check_module(module: ModuleType) -> None:
    """Replace the annotated functions of a module, and the methods of its classes, by checked ones."""
    _check_attributes(module, module.__name__)
    for value in list(vars(module).values()):
        is_own = isinstance(value, type) and value.__module__ == module.__name__
        if is_own and not getattr(value, "_is_protocol", False):
            _check_attributes(value, module.__name__)


def _check_attributes(owner: Any, module: str) -> None:
    for name, value in list(vars(owner).items()):
        checked = _checked(value, module)
        if checked is not value:
            setattr(owner, name, checked)


def _checked(value: Any, module: str) -> Any:
    """The checked function, method or property; anything else as it is."""
    match value:
        case FunctionType():
            # What another decorator wraps has other types than the annotations state.
            is_plain = value.__module__ == module and not hasattr(value, "__wrapped__")
            is_async = inspect.iscoroutinefunction(value) or inspect.isasyncgenfunction(value)
            return check(value) if is_plain and value.__annotations__ and not is_async else value
        case classmethod() | staticmethod():
            return type(value)(_checked(value.__func__, module))
        case property():
            return property(*(_checked(each, module) for each in (value.fget, value.fset, value.fdel)))
        case functools.cached_property():
            value.func = _checked(value.func, module)
    return value


class _Loader(importlib.machinery.SourceFileLoader):
    def exec_module(self, module: ModuleType) -> None:
        super().exec_module(module)
        check_module(module)


class _Finder(MetaPathFinder):
    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name != PACKAGE and not name.startswith(f"{PACKAGE}."):
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, path, target)
        if spec is not None and isinstance(spec.loader, importlib.machinery.SourceFileLoader):
            spec.loader = _Loader(spec.loader.name, spec.loader.path)
        return spec


def install() -> None:
    """Check the package, which must not have been imported yet."""
    assert PACKAGE not in sys.modules
    sys.meta_path.insert(0, _Finder())
