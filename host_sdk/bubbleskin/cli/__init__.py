"""The `bubbleskin` command: verbs only, no logic."""

from bubbleskin.cli.entry import main

__all__ = ["main"]
