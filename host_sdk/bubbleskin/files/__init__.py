"""Files of every kind, read and written in one way: sizes are bounded, mistakes are sentences that name their place."""

from bubbleskin.files.arrays import read_npy
from bubbleskin.files.images import is_image, read_image
from bubbleskin.files.reading import path_of, read_bytes, read_text
from bubbleskin.files.tables import Cell, CellError, Grid, read_table, width
from bubbleskin.files.trees import parse_json, parse_toml
from bubbleskin.files.writing import guarded, write_bytes, write_text

__all__ = [
    "Cell",
    "CellError",
    "Grid",
    "guarded",
    "is_image",
    "parse_json",
    "parse_toml",
    "path_of",
    "read_bytes",
    "read_image",
    "read_npy",
    "read_table",
    "read_text",
    "width",
    "write_bytes",
    "write_text",
]
