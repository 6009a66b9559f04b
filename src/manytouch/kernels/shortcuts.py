# mypy: disable-error-code="no-untyped-call,method-assign,misc"
# numba has no types, and methods of it are replaced here.
"""Shortcuts through numba while kernels of this package are compiled; results keep their bits.

They are in use while `use_shortcuts` is entered, so that other programs with numba are compiled as before.
Where numba lacks one of the replaced functions that shortcut is left out, and compiling takes longer.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

from numba.core import cpu, types
from numba.core.targetconfig import ConfigStack, TargetConfig
from numba.extending import overload
from numba.np import arrayobj

Replacement = tuple[Any, str, Any]
"""Owner, name of the attribute, and what replaces it."""

_known_calls: dict[Any, Any] = {}


@contextmanager
def use_shortcuts() -> Iterator[None]:
    """Replace functions of numba for as long as it is entered; numba compiles one function at a time."""
    with ExitStack() as after:
        for make in (quick_flags, known_calls, plain_shape_errors, no_wrappers_of_parts):
            with suppress(AttributeError):
                for owner, name, function in make():
                    after.callback(setattr, owner, name, getattr(owner, name))
                    setattr(owner, name, function)
        yield


def quick_flags() -> list[Replacement]:
    """Compare flags without making dictionaries of them; numba does so 180 000 times for a method."""

    def equal(self: Any, other: Any) -> Any:
        if type(self) is not type(other):
            return NotImplemented
        own, others = self._values, other._values
        return own == others or all(
            getattr(self, name) == getattr(other, name) for name in own.keys() | others.keys()
        )

    def hashed(self: Any) -> int:
        return hash(type(self))  # as before it does not depend on the values

    return [(TargetConfig, "__eq__", equal), (TargetConfig, "__hash__", hashed)]


def known_calls() -> list[Replacement]:
    """Remember which implementation of a built-in function suits which types of arguments.

    numba tries all of them at each call, and formats a message for each that does not.
    """
    find = types.BaseFunction.get_call_type

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        flags = ConfigStack.top_or_none()
        options = flags and tuple((name, str(value)) for name, value in flags._values.items())
        key = id(self), id(context), tuple(args), tuple(kws.items()), options
        if key not in _known_calls:
            # with `self` and `context`, so that nothing else gets their addresses
            _known_calls[key] = find(self, context, args, kws), self, context
        return _known_calls[key][0]

    return [(types.BaseFunction, "get_call_type", get_call_type)]


def _shapes_differ(source: Any, target: Any) -> None:
    """Stands for the function that raises an error in compiled code."""


with suppress(AttributeError):
    overload(_shapes_differ)(arrayobj.ol_raise_with_shape_context_generic)

# numba knows this function, and not the one that checks of types in tests put in its place
_SHAPE_ERRORS: list[Replacement] = [(arrayobj, "raise_with_shape_context", _shapes_differ)]


def plain_shape_errors() -> list[Replacement]:
    """Errors of slices without the shapes in the message, for which numba compiles 80 functions on texts."""
    return _SHAPE_ERRORS


def no_wrappers_of_parts() -> list[Replacement]:
    """What only compiled functions call needs no wrapper, neither for Python nor for C."""

    def unless_part(create: Callable[..., None]) -> Callable[..., None]:
        def create_wrapper(self: Any, library: Any, *rest: Any, **named: Any) -> None:
            if not getattr(library, "is_part", False):
                create(self, library, *rest, **named)

        return create_wrapper

    names = "create_cfunc_wrapper", "create_cpython_wrapper"
    return [(cpu.CPUContext, name, unless_part(getattr(cpu.CPUContext, name))) for name in names]
