"""What Python calls of a compiled function, as LLVM's text: numbers out of objects, the call, an object out of a number.

This is CPython's METH_FASTCALL convention, without the look at types that numba's own way in takes at every call.
"""

from bubbleskin.native.assembly import Signature

_OBJECTS = {"TypeError": TypeError, "ZeroDivisionError": ZeroDivisionError, "None": None}

PREFIX = "entry_"
"""Of the symbol that Python calls."""

OBJECTS = {f"bubbleskin_{name}": thing for name, thing in _OBJECTS.items()}
"""Python's objects that native code names, by symbol; they live as long as Python does."""

_KINDS = {
    "i64": ("i64", "PyLong_AsLongLong"),
    "double": ("double", "PyFloat_AsDouble"),
    "ptr": ("i64", "PyLong_AsLongLong"),
}
_BACK = {"i64": "PyLong_FromLongLong", "double": "PyFloat_FromDouble"}

HEAD = """
declare i64 @PyLong_AsLongLong(ptr)
declare double @PyFloat_AsDouble(ptr)
declare ptr @PyLong_FromLongLong(i64)
declare ptr @PyFloat_FromDouble(double)
declare ptr @PyErr_Occurred()
declare void @PyErr_SetString(ptr, ptr)
declare void @Py_IncRef(ptr)
; numba's counts of references end here. Nothing that may be kept allocates, so nothing is ever freed.
declare void @llvm.trap()
define void @NRT_MemInfo_call_dtor(ptr %memory) {
  call void @llvm.trap()
  unreachable
}
@bubbleskin_TypeError = external global i8
@bubbleskin_ZeroDivisionError = external global i8
@bubbleskin_None = external global i8
@said_zero = private constant [17 x i8] c"division by zero\\00"
"""


def entry(name: str, signature: Signature) -> str:
    """The function `entry_NAME`, which calls what `signature` describes."""
    symbol, kinds, returns = signature
    said = f"{name} takes {len(kinds)} numbers"
    lines, arguments = [], []
    for k, kind in enumerate(kinds):
        number, convert = _KINDS[kind]
        lines += [
            f"  %at{k} = getelementptr ptr, ptr %args, i64 {k}",
            f"  %object{k} = load ptr, ptr %at{k}",
            f"  %number{k} = call {number} @{convert}(ptr %object{k})",
        ]
        if kind == "ptr":
            lines.append(f"  %pointer{k} = inttoptr i64 %number{k} to ptr")
        arguments.append(f", {kind} %{'pointer' if kind == 'ptr' else 'number'}{k}")
    declared = "".join(f", {kind}" for kind in kinds)
    back = ["  call void @Py_IncRef(ptr @bubbleskin_None)", "  ret ptr @bubbleskin_None"]
    if returns:
        back = [
            f"  %number = load {returns}, ptr %result",
            f"  %object = call ptr @{_BACK[returns]}({returns} %number)",
            "  ret ptr %object",
        ]
    return "\n".join(
        [
            f'declare i32 @"{symbol}"(ptr, ptr{declared})',
            f'@said_{name} = private constant [{len(said) + 1} x i8] c"{said}\\00"',
            f"define ptr @{PREFIX}{name}(ptr %self, ptr %args, i64 %count) {{",
            "  %result = alloca i64",
            "  %reason = alloca ptr",
            f"  %right = icmp eq i64 %count, {len(kinds)}",
            "  br i1 %right, label %given, label %few",
            "few:",
            *_raised("TypeError", f"said_{name}"),
            "given:",
            *lines,
            "  %error = call ptr @PyErr_Occurred()",
            "  %fine = icmp eq ptr %error, null",
            "  br i1 %fine, label %go, label %failed",
            "failed:",
            "  ret ptr null",
            "go:",
            f'  %status = call i32 @"{symbol}"(ptr %result, ptr %reason{"".join(arguments)})',
            "  %done = icmp eq i32 %status, 0",
            "  br i1 %done, label %answer, label %zero",
            "zero:",
            *_raised("ZeroDivisionError", "said_zero"),
            "answer:",
            *back,
            "}",
            "",
        ]
    )


def _raised(kind: str, said: str) -> list[str]:
    return [f"  call void @PyErr_SetString(ptr @bubbleskin_{kind}, ptr @{said})", "  ret ptr null"]
