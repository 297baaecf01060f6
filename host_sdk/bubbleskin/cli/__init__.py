"""The `bubbleskin` command: verbs only, no logic."""

from bubbleskin.cli.main import main

__all__ = ["main"]
