"""Every bench runs, once and in small: what it measures is asked of the full size, that it measures is asked here."""

import json
import math
import pkgutil

import pytest
from click.testing import CliRunner

import bubbleskin.bench
from bubbleskin.bench import BENCHES, LONG, measure
from bubbleskin.cli.bench import bench

pytestmark = pytest.mark.slow

SMALL = 0.005
ON_THE_CHIP = {"rp2040", "profile", "profile_page", "trace", "float_law"}


@pytest.mark.parametrize("name", [name for name in BENCHES if name not in LONG])
def test_a_bench_in_small(name, request):
    if name == "link":
        request.getfixturevalue("micropython")
    rows = list(measure(name, SMALL))
    assert rows
    for row in rows:
        assert row.name.strip()
        assert math.isfinite(row.value) or (row.unit == "s" and "pings for" in row.name), row
        assert row.value > 0 or row.unit == "", row
        assert row.unit or "power" in row.name, row
    names = [row.name for row in rows if not row.name.startswith((" ", "the same"))]
    assert len(set(names)) == len(names)


def test_every_bench_is_listed():
    modules = {module.name for module in pkgutil.iter_modules(bubbleskin.bench.__path__)}
    assert modules == {*BENCHES, *ON_THE_CHIP, "rows", "report", "pages"}


def test_the_command_prints_rows_for_scripts():
    run = CliRunner().invoke(bench, ["codec", "--json"])
    assert run.exit_code == 0
    rows = json.loads(run.stdout)
    assert len(rows) == 12
    assert all(set(row) == {"name", "value", "unit", "target"} for row in rows)
