"""Record a pulse to a table, and find when each bubble was highest. pandas reads it too: read_csv(path, comment="#")."""

import csv
import sys
import tempfile
from pathlib import Path

import bubbleskin as bs

path = Path(tempfile.mkdtemp()) / "pulse.csv"
with bs.connect(sys.argv[1] if len(sys.argv) > 1 else "sim://wristband7") as skin:
    with skin.record(path, rate_hz=50):
        skin.play(bs.sequences.pulse(skin.layout, loops=1))
    rows = list(csv.DictReader(line for line in path.read_text().splitlines() if not line.startswith("#")))
    for bubble in range(skin.info.bubbles):
        highest = max(rows, key=lambda row: float(row[f"height_mm_{bubble}"]))
        print(f"bubble {bubble} was highest after {float(highest['time_s']) - float(rows[0]['time_s']):.2f} s")
