"""`python -m bubbleskin.cli` is the `bubbleskin` command."""

from bubbleskin.cli import main

main()
