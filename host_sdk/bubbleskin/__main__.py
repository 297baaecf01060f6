"""`python -m bubbleskin` is the `bubbleskin` command."""

import os

try:
    from bubbleskin.cli import main
except KeyboardInterrupt:  # before `main` is there to understand it
    os.write(2, b"Stopped.\n")
    os._exit(130)

main()
