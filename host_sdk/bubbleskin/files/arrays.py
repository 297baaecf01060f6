"""numpy's own files. Their header is a claim: it is held against what the file has before anything is allocated."""

import io
import math
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from bubbleskin.errors import InvalidInput
from bubbleskin.files.reading import path_of, read_bytes

_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def read_npy(path: Any, what: str) -> NDArray[np.float64]:
    """The numbers in a .npy file, as floats; `InvalidInput` for anything else."""
    data = read_bytes(path, what)
    name = path_of(path, what)
    if not data:
        raise InvalidInput(f"{name} is empty, so it is not {what}.")
    file = io.BytesIO(data)
    try:
        version = npy.read_magic(file)
        shape, fortran, kind = _HEADERS[version](file)
        count = math.prod(shape)
        if kind.kind not in "fiu" or kind.hasobject:
            raise InvalidInput(f"{name} has entries of the kind {kind}; {what} has real numbers.")
        left = len(data) - file.tell()
        if min(shape, default=0) < 0 or count * kind.itemsize != left:
            raise InvalidInput(
                f"{name} says that it has {count} numbers of {kind.itemsize} bytes, but {left} bytes follow: it is damaged."
            )
        values = np.frombuffer(data, kind, count, file.tell())
        return values.reshape(shape, order="F" if fortran else "C").astype(float)
    except InvalidInput:
        raise
    except Exception:  # a header is parsed as Python is, and raises as much
        raise InvalidInput(
            f"{name} is not a .npy file that can be read; write it with numpy.save(path, heights)."
        ) from None
