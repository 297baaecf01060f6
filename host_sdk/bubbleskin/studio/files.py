"""Where the files are that browsers get."""

from pathlib import Path

STATIC = Path(__file__).parent / "static"
"""Style, scripts, icon: served as they are at /studio."""
