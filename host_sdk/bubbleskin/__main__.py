"""`python -m bubbleskin` is the `bubbleskin` command."""

from bubbleskin.cli import main

main()
