"""Boards as data, by name or by file: found, loaded and checked. What stands in a board's file is in docs/boards.md."""

from bubbleskin.boards.fields import NEIGHBOUR
from bubbleskin.boards.find import DEFAULT, NAMES, is_file, load, own_file

__all__ = ["DEFAULT", "NAMES", "NEIGHBOUR", "is_file", "load", "own_file"]
