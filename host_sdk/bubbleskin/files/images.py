"""Pictures as arrays of brightness or elevation: PNG, JPEG, BMP, WebP, and TIFF with numbers of any size, as GeoTIFF has them."""

import io
import math
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bubbleskin.errors import InvalidInput
from bubbleskin.files.reading import path_of, read_bytes

if TYPE_CHECKING:
    from PIL.Image import Image

ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".webp", ".tif", ".tiff")
_FORMATS = ("PNG", "JPEG", "BMP", "WEBP", "TIFF")
PIXELS_MAX = 10_000_000
_NO_DATA = 42113
"""GDAL's tag of TIFF: which number stands for nothing known."""
_NUMBERS = ("1", "L", "I", "F", "I;16", "I;16L", "I;16B", "I;16N")
"""Kinds of pictures that have one number a pixel; of all others the brightness is taken."""


def is_image(path: Path) -> bool:
    """Whether a file's name ends as those of pictures do."""
    return path.suffix.lower() in ENDINGS


def read_image(path: Any, what: str) -> NDArray[np.float64]:
    """Brightness or elevation of every pixel, (rows, columns), the first row at the top; nan where a TIFF knows nothing.

    Colours become their brightness. Raises `InvalidInput` for what is no picture, or has more than `PIXELS_MAX` pixels.
    """
    from PIL import Image, UnidentifiedImageError

    data = read_bytes(path, what)
    name = path_of(path, what)
    try:
        with (
            warnings.catch_warnings()
        ):  # a picture that is too large is refused below, a damaged note in it harms nobody
            warnings.simplefilter("ignore")
            with Image.open(io.BytesIO(data), formats=_FORMATS) as image:
                if image.width * image.height > PIXELS_MAX:
                    raise InvalidInput(
                        f"{name} has {image.width} by {image.height} pixels; {PIXELS_MAX} in all are allowed. Make it smaller."
                    )
                return _numbers(image)
    except InvalidInput:
        raise
    except UnidentifiedImageError:
        raise InvalidInput(f"{name} is not a picture that can be read; {', '.join(ENDINGS)} are.") from None
    except Exception as error:  # what is damaged inside raises as much as there are formats
        why = " ".join(str(error).split()).rstrip(".") or type(error).__name__
        raise InvalidInput(f"{name} is a picture that cannot be read: {why}.") from None


def _numbers(image: "Image") -> NDArray[np.float64]:
    values = np.array(image if image.mode in _NUMBERS else image.convert("L"), dtype=float)
    tags = getattr(image, "tag_v2", {})
    if _NO_DATA in tags:
        unknown = float(str(tags[_NO_DATA]).strip("\0 "))
        values[np.isnan(values) if math.isnan(unknown) else values == np.float32(unknown)] = np.nan
    return values
