# mypy: disable-error-code="no-untyped-call,misc"
# numba has no types.
"""Machine code of kernels in files, loaded without what only compiling needs.

Before numba loads the code of a function it makes known all functions that it can compile, and it reads the
intermediate code from which other functions could be compiled. Neither is needed here: a kernel that another
one calls is compiled from its source (`compilation.kernel`). A kernel that is not in the files is compiled,
and numba then makes known what it can compile.
"""

from functools import cache
from typing import Any

import llvmlite.binding as llvm
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.runtime import _nrt_python  # type: ignore[attr-defined]  # an extension module


class MachineCode(CompileResultCacheImpl):
    """What is kept of a compiled function: machine code without intermediate code."""

    def reduce(self, result: Any) -> tuple[Any, ...]:
        """The values that are written."""
        return _without_intermediate_code(super().reduce(result))

    def rebuild(self, context: Any, kept: Any) -> Any:
        """The compiled function, from the values that were read."""
        library, description, *others = _without_intermediate_code(kept)
        # numba looks for a function only if it has read its name in the intermediate code
        names = description.llvm_func_name, description.llvm_cpython_wrapper_name
        context.codegen()._engine._defined_symbols.update(names)
        return super().rebuild(context, (library, description, *others))


class KernelCache(FunctionCache):
    """The files of one kernel."""

    _impl_class = MachineCode

    def load_overload(self, signature: Any, context: Any) -> Any:
        """The code for these types of arguments; None if it is not in the files."""
        _provide_memory_functions()
        with self._guard_against_spurious_io_errors():
            return self._load_overload(signature, context)


@cache
def _provide_memory_functions() -> None:
    """Make known what machine code calls for the memory of arrays.

    numba does the same in `rtsys.initialize`, which also compiles functions that machine code in files
    contains already. For that alone 25 MB of the compiler would be read.
    """
    for name, address in _nrt_python.c_helpers.items():
        llvm.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


def keep_in_files(kernel: Any) -> None:
    """Let a compiled function be kept in files; by numba's own way where that lacks what is used here."""
    if all(hasattr(FunctionCache, name) for name in ("_load_overload", "_guard_against_spurious_io_errors")):
        kernel._cache = KernelCache(kernel.py_func)
    else:
        kernel.enable_caching()


def _without_intermediate_code(kept: Any) -> tuple[Any, ...]:
    (name, kind, code), *others = kept
    if kind != "object":
        return tuple(kept)
    machine_code, _ = code
    return (name, kind, (machine_code, _no_code())), *others


@cache
def _no_code() -> bytes:
    return bytes(llvm.parse_assembly("").as_bitcode())
