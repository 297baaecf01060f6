"""What shows itself as a picture where a notebook asks for one."""

from importlib import import_module

DRAWN_BY = "bubbleskin.plot.notebook"
"""Stands above all that it draws, and loads matplotlib: it is called by its name, when the first picture is asked for."""


class Pictured:
    """Has a picture in notebooks, of what it is at that moment; `plot/notebook.py` says which."""

    def _repr_png_(self) -> bytes | None:
        """What IPython asks for; None, and it shows the `repr`, where there is nothing to draw."""
        picture: bytes | None = import_module(DRAWN_BY).draw(self)
        return picture
