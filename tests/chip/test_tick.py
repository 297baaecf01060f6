"""The tick on the emulated chip, in emulated time, which is the same in every run: nothing here depends on the machine."""

import pytest

from bubble_firmware import boards

pytestmark = pytest.mark.chip


@pytest.mark.promise("memory")
@pytest.mark.parametrize("name", ["wristband7", "wristband19"])
def test_no_tick_is_late_and_the_heap_stays_as_it_is(uf2, name):
    """Under telemetry at 50 Hz and SHOW at 20 Hz; `bubbleskin bench --target rp2040` does the same for 5 s."""
    from bubbleskin.bench.rp2040 import load

    uf2(name)  # built, or the test is skipped
    busy = load(name, 1.0)
    tick = boards.load(name).TICK_US
    assert busy.ticks * tick == pytest.approx(busy.elapsed_us, abs=2 * tick), "ticks are missing, or not counted"
    assert busy.telemetry >= 45
    assert busy.late == 0
    assert busy.heap_lost == 0, "something allocates in every tick, or at every request"
    assert busy.mean_us < LIMIT_US[name]
    assert busy.worst_us < tick


LIMIT_US = {"wristband7": 1500, "wristband19": 3900}
"""What a tick may take on the average, as the histogram of TICKS tells it: upper edges of bins of a fiftieth tick."""
