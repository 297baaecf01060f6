"""numba's `njit`, which waits with importing numba until a function is called from Python, or compiled."""

from collections.abc import Callable
from functools import cache
from typing import Any

from bubbleskin.native.said import say_compiling, say_unkept


def njit(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """As `numba.njit`: `@njit`, `@njit(inline="always")`, `njit(function)`. Compiling is announced."""
    if function is None:
        return lambda function: Later(function, options)
    return Later(function, options)


class Later:
    """A function that numba is to compile."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]):
        self._function = function
        self._options = {"no_cfunc_wrapper": True, **options}  # nobody calls them from C
        self._made: Any = None
        self.__doc__ = function.__doc__

    @property
    def compiled(self) -> Any:
        """numba's function; those that it may call are numba's too from now on, as of `resolve`."""
        if self._made is None:
            try:
                self._made = _numba().njit(**self._options)(self._function)
            except RuntimeError as error:  # there is no folder for numba's cache
                self._do_without_cache(error)
            resolve(self._function.__globals__)
        return self._made

    def __call__(self, *arguments: Any) -> Any:
        """Compile it for these arguments, if that was not done before, and call it."""
        try:
            return self.compiled(*arguments)
        except OSError as error:  # the disk is full: raised once all is compiled, and before anything has run
            self._do_without_cache(error)
            return self._made(*arguments)

    def _do_without_cache(self, error: Exception) -> None:
        if not self._options.get("cache"):
            raise error
        self._options["cache"] = False
        say_unkept("numba's cache", error)
        self._made = _numba().njit(**self._options)(self._function)


def resolve(names: dict[str, Any]) -> None:
    """Put numba's functions in the place of those that wait, in a module's namespace, and where they come from too."""
    for name, value in list(names.items()):
        if isinstance(value, Later):
            names[name] = value.compiled


@cache
def _numba() -> Any:
    """numba, which from now on says when it compiles."""
    import numba
    from numba.core import event

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            say_compiling()

        def on_end(self, event: Any) -> None:
            pass

    event.register("numba:compile", Listener())
    return numba
