"""A picture to a file, through the writer that all files go through."""

import io
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from bubbleskin.errors import InvalidInput
from bubbleskin.files import path_of, write_bytes


def save(figure: Figure, path: str | Path, **options: Any) -> None:
    """Write a picture in the format that the ending of ``path`` names (png, svg, pdf); `options` are those of ``savefig``."""
    kind = path_of(path, "the picture").suffix.lower().lstrip(".") or "png"
    drawn = io.BytesIO()
    try:
        figure.savefig(drawn, format=kind, **options)
    except ValueError as error:
        raise InvalidInput(f"cannot write the picture {path}: {str(error).rstrip('.')}.") from None
    write_bytes(path, drawn.getvalue(), "the picture")
