# mypy: disable-error-code="no-untyped-call,method-assign,misc"
# numba has no types, and methods of it are replaced here.
"""How numba makes machine code of compiled functions: only those that Python calls get some of their own.

numba optimises each function, makes machine code of it and wraps it for Python, also where only other
compiled functions call it; each of these optimises it again. Nine of ten functions here are such parts.
"""

from typing import Any

from llvmlite.binding import Linkage
from numba.core import typed_passes
from numba.core.codegen import CPUCodeLibrary, JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.cpu import CPUContext
from numba.core.environment import lookup_environment

from manytouch.kernels.shortcuts import use_shortcuts

OWN_NAMES = "9manytouch"
"""Part of the mangled names of the functions of this package."""
ENVIRONMENT = "_ZN08NumbaEnv"
"""Beginning of the names of variables that contain the Python objects of a function, such as exceptions."""

_called_by_python: Any = None  # state of the compilation that is under way, changed under numba's lock


class KernelCompiler(Compiler):
    """Compiles a function that Python calls; all functions that are compiled meanwhile are its parts."""

    def compile_extra(self, func: Any) -> Any:
        """Compile; see numba."""
        global _called_by_python  # noqa: PLW0603 - numba compiles one function at a time
        if _called_by_python is not None:
            return super().compile_extra(func)
        _called_by_python = self.state
        try:
            with use_shortcuts():
                return super().compile_extra(func)
        finally:
            _called_by_python = None


class PartLibrary(JITCodeLibrary):
    """Intermediate code of a part, without machine code.

    It is optimised with the function that contains it. If it may reorder sums it is optimised for itself
    before, which determines their order, and with it the bits of the results.
    """

    is_part = True  # as `kernels.shortcuts` recognises it
    may_reorder = False

    def get_pointer_to_function(self, name: str) -> int:
        """There is no machine code, and so no address."""
        return 0

    def finalize(self) -> None:
        """Make it ready to be linked to others."""
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        if self.may_reorder:
            self._optimize_final_module()
        self._finalize_dynamic_globals()
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.external:
                function.linkage = Linkage.linkonce_odr
        self._shared_module, self._finalized = self._final_module, True

    def _optimize_functions(self, ll_module: Any) -> None:
        if self.may_reorder:
            super()._optimize_functions(ll_module)
        else:
            ll_module.data_layout = self._codegen._data_layout


def compile_parts_without_code() -> bool:
    """Let functions that are compiled because another kernel calls them be intermediate code only.

    Returns:
        Whether it was possible; it replaces internal methods of numba, without which all else works.
    """
    try:
        lower, executable = typed_passes.BaseNativeLowering.run_pass, CPUContext.get_executable
        finalize = JITCodeLibrary._finalize_specific
    except AttributeError:
        return False
    if getattr(lower, "knows_parts", False):
        return True

    def lower_part(self: Any, state: Any) -> bool:
        if _called_by_python is not None and state is not _called_by_python and state.library is None:
            library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
            library.may_reorder = bool(state.flags.fastmath)
            library.enable_object_caching()
            state.library = library
        return bool(lower(self, state))

    def executable_or_name(self: Any, library: Any, description: Any, environment: Any) -> Any:
        if isinstance(library, PartLibrary):
            return {}.popitem  # numba needs a built-in function that equals no other; it is never called
        return executable(self, library, description, environment)

    def finalize_with_environments(library: Any) -> None:
        finalize(library)
        for variable in library._final_module.global_variables:
            if variable.name.startswith(ENVIRONMENT) and not variable.is_declaration:
                environment = lookup_environment(variable.name)
                if environment is not None:
                    library._codegen.set_env(variable.name, environment)

    lower_part.knows_parts = True  # type: ignore[attr-defined]
    typed_passes.BaseNativeLowering.run_pass = lower_part
    CPUContext.get_executable = executable_or_name
    JITCodeLibrary._finalize_specific = finalize_with_environments
    return True


def bind_calls_within_modules() -> bool:
    """Let a compiled function call the copies of others that were optimised with it, fresh or cached.

    The machine code of a function contains the functions that it calls. numba marks them as replaceable by a
    function of the same name that is loaded already, whose code may be optimised otherwise: its sums are then
    rounded otherwise. What is loaded already depends on what was compiled, what came from the cache, and in
    which order, so the run that compiled had other bits than later ones.

    Returns:
        Whether it was possible; it uses an internal method of numba, without which all else works.
    """
    finalize = getattr(CPUCodeLibrary, "_finalize_final_module", None)
    if finalize is None or not hasattr(CPUCodeLibrary, "_get_module_for_linking"):
        return False
    if not getattr(finalize, "binds_calls", False):

        def finalize_bound(library: Any) -> None:
            bind_calls(library)
            finalize(library)

        finalize_bound.binds_calls = True  # type: ignore[attr-defined]
        CPUCodeLibrary._finalize_final_module = finalize_bound
    return True


def bind_calls(library: Any) -> None:
    """Make replaceable functions of a module of this package local, except in the copy for its callers."""
    module = library._final_module
    replaceable = [
        function
        for function in module.functions
        if not function.is_declaration
        and function.linkage == Linkage.linkonce_odr
        and not function.name.startswith("NRT_")
    ]
    if not replaceable or not any(OWN_NAMES in function.name for function in module.functions):
        return
    library._finalized = True
    try:
        is_shared = library._get_module_for_linking() is module
    finally:
        library._finalized = False
    if is_shared:
        library._shared_module = module.clone()
    for function in replaceable:
        function.linkage = Linkage.internal
