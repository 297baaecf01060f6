"""The models of the chips, held against the bits and times of their datasheets."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rp2040py")

from rp2040py.clock.simulation_clock import SimulationClock
from rp2040py.rp2040 import RP2040

from bubbleskin.sim.plant import Plant, PlantParameters
from bubbleskin.sim.rp2040.abp2 import Abp2
from bubbleskin.sim.rp2040.bus import I2cBus, SpiBus
from bubbleskin.sim.rp2040.mcp3208 import Mcp3208
from bubbleskin.sim.rp2040.pca9685 import Pca9685
from bubbleskin.sim.rp2040.tca9548a import Tca9548a
from bubbleskin.sim.rp2040.valves import FILL, VENT, Valves


def chip():
    """As much of a chip as a model needs: a clock."""
    return SimpleNamespace(mcu=SimpleNamespace(clock=SimulationClock()))


def converted(converter: Mcp3208, *sent: int) -> list[int]:
    converter.select(True)
    answer = [converter.transfer(byte) for byte in sent]
    converter.select(False)
    return answer


# ---- MCP3208


@pytest.mark.parametrize("channel", range(8))
def test_mcp3208_answers_three_bytes_as_in_figure_6_1(channel):
    inputs = [0x000, 0xFFF, 0x5A5, 0xA5A, 0x800, 0x001, 0x123, 0xEDC]
    _, high, low = converted(Mcp3208(inputs.__getitem__), 6 | channel >> 2, (channel & 3) << 6, 0)
    assert high & 0x10 == 0  # the null bit
    assert (high & 15) << 8 | low == inputs[channel]


def test_mcp3208_waits_for_the_start_bit_wherever_it_comes():
    # Five clocks earlier than in the figure: start, single, channel 5; a clock to sample; null; twelve bits.
    converter = Mcp3208(lambda channel: 0xABC if channel == 5 else 0)
    first, second, _ = converted(converter, 0b11101000, 0, 0)
    assert first & 3 == 1  # the null bit is in the seventh clock, bit 11 in the eighth
    assert second == 0xABC >> 3 & 255


def test_mcp3208_repeats_its_bits_the_other_way_round_and_then_zeros():
    _, _, _, again, rest, zeros = converted(Mcp3208(lambda channel: 0b1000_0000_0011), 6, 0, 0, 0, 0, 0)
    assert again == 0b1000_0000  # bits 1 to 8
    assert rest == 0b0010_0000  # bits 9 to 11, then zeros
    assert zeros == 0


def test_mcp3208_measures_a_difference_and_clips_it_at_zero():
    converter = Mcp3208([1000, 300, 0, 0, 0, 0, 0, 0].__getitem__)
    _, high, low = converted(converter, 4, 0, 0)
    assert (high & 15) << 8 | low == 700
    _, high, low = converted(converter, 4, 0x40, 0)
    assert (high & 15) << 8 | low == 0


def test_a_dead_mcp3208_drives_nothing():
    converter = Mcp3208(lambda channel: 0)
    converter.silent = True
    assert converted(converter, 6, 0, 0) == [255, 255, 255]


# ---- the buses


def spi(mcu, hz: float):
    block = mcu.spi[0]
    block.write_uint32(0x010, round(mcu.clk_peri / hz))  # SSPCPSR
    block.write_uint32(0x000, 7)  # SSPCR0: eight bits
    block.write_uint32(0x004, 2)  # SSPCR1: on
    return block


def test_spi_takes_the_time_of_its_bits():
    mcu = RP2040()
    SpiBus(SimpleNamespace(mcu=mcu), 0)
    block = spi(mcu, 1e6)
    for _ in range(3):
        block.write_uint32(0x008, 0)
    bits = 3 * (8 + 1.5)
    mcu.clock.tick(bits * 1e9 / block.clock_frequency - 1)
    assert block.read_uint32(0x00C) & 16  # busy
    mcu.clock.tick(2)
    assert not block.read_uint32(0x00C) & 16
    assert [block.read_uint32(0x008) for _ in range(3)] == [255] * 3  # nobody is there: pulled up


class Recorder:
    """An I2C chip at 0x40 that notes what happens and when."""

    def __init__(self, clock):
        self.seen = []
        self._clock = clock

    def start(self, address, read):
        self.seen.append(("start", address, read, self._clock.nanos))
        return address == 0x40

    def write(self, byte):
        self.seen.append(("write", byte, self._clock.nanos))
        return True

    def read(self):
        return 0x42

    def stop(self):
        self.seen.append(("stop", self._clock.nanos))


def i2c(mcu, address: int, *commands: int):
    block = mcu.i2c[0]
    block.write_uint32(0x1C, 50)  # IC_FS_SCL_HCNT
    block.write_uint32(0x20, 75)  # IC_FS_SCL_LCNT
    block.write_uint32(0xA0, 4)  # IC_FS_SPKLEN
    block.write_uint32(0x04, address)
    block.write_uint32(0x6C, 1)
    for command in commands:
        block.write_uint32(0x10, command)
    return block


def test_i2c_takes_the_time_of_its_bits():
    mcu = RP2040()
    device = Recorder(mcu.clock)
    bus = I2cBus(SimpleNamespace(mcu=mcu), 0)
    bus.add(device)
    block = i2c(mcu, 0x40, 0x11, 0x22 | 0x200)
    mcu.clock.tick(1e6)
    bit = (50 + 75 + block._spikelen + 7 + 1) * 8  # ns: clocks of SCL, RP2040 datasheet 4.3.14.1
    times = [event[-1] for event in device.seen]
    assert times == pytest.approx([10 * bit, 19 * bit, 28 * bit, 29 * bit])


def test_i2c_aborts_where_nobody_acknowledges():
    mcu = RP2040()
    I2cBus(SimpleNamespace(mcu=mcu), 0).add(Recorder(mcu.clock))
    block = i2c(mcu, 0x41, 0x11 | 0x200)
    mcu.clock.tick(1e6)
    assert block.read_uint32(0x80) & 1  # IC_TX_ABRT_SOURCE: 7-bit address not acknowledged


# ---- PCA9685


def transfer(device, address, *data):
    if not device.start(address, False):
        return False
    taken = all(device.write(byte) for byte in data)
    device.stop()
    return taken


def register(device, number):
    transfer(device, 0x40, number)
    assert device.start(0x40, True)
    value = device.read()
    device.stop()
    return value


@pytest.fixture
def pwm():
    """A PCA9685 at 0x40 and the list of its edges: (µs, output, level)."""
    base, edges, hz = chip(), [], [0.0]
    clock = base.mcu.clock
    device = Pca9685(base, 0x40, lambda output, level: edges.append((clock.nanos / 1e3, output, level)), lambda: hz[0])
    return SimpleNamespace(device=device, edges=edges, hz=hz, clock=clock)


def test_pca9685_after_power_on(pwm):
    assert register(pwm.device, 0x00) == 0x11
    assert register(pwm.device, 0x01) == 0x04
    assert register(pwm.device, 0xFE) == 0x1E
    assert register(pwm.device, 0x09) == 0x10  # LED0 always off
    assert not pwm.device.start(0x41, False)
    assert pwm.device.start(0x70, False)  # all-call


def test_pca9685_pulses_with_its_own_oscillator(pwm):
    transfer(pwm.device, 0x40, 0x00, 0x30)  # asleep, auto-increment
    transfer(pwm.device, 0x40, 0xFE, 5)
    transfer(pwm.device, 0x40, 0x06, 0, 0, 0x00, 0x04, 0x00, 0x08, 0x00, 0x0C)  # 0 to 1024, 2048 to 3072
    assert pwm.edges == []
    transfer(pwm.device, 0x40, 0x00, 0x20)
    pwm.clock.tick(1.5e6)
    count = 6 / 25  # µs
    assert [(output, level) for _, output, level in pwm.edges[:5]] == [
        (0, True), (0, False), (1, True), (1, False), (0, True)
    ]  # fmt: skip
    assert [time for time, *_ in pwm.edges[:5]] == pytest.approx([c * count for c in (0, 1024, 2048, 3072, 4096)])


def test_pca9685_takes_new_values_when_the_counter_wraps_and_whole_transfers_only(pwm):
    pwm.hz[0] = 4.096e6  # one count is 5 µs / 5
    for data in ((0x00, 0x10), (0x00, 0x50), (0xFE, 4), (0x00, 0x70)):
        transfer(pwm.device, 0x40, *data)
    transfer(pwm.device, 0x40, 0x06, 0, 0, 0x00, 0x08)  # half
    transfer(pwm.device, 0x40, 0x00, 0x60)
    period = 5000.0  # µs
    pwm.clock.tick(1e6)
    pwm.device.start(0x40, False)
    for byte in (0x06, 0, 0, 0x00):
        pwm.device.write(byte)
    pwm.clock.tick(period * 1e3)  # the transfer is under way while the counter wraps
    pwm.device.write(0x04)
    pwm.device.stop()
    pwm.clock.tick(2 * period * 1e3)
    falls = [time for time, _, level in pwm.edges if not level]
    assert falls == pytest.approx([period / 2, 1.5 * period, 2.25 * period], abs=1)


def test_pca9685_stands_still_with_its_clock_and_goes_on_with_it(pwm):
    for data in ((0x00, 0x10), (0x00, 0x50), (0xFE, 4), (0x00, 0x70), (0x06, 0, 0, 0, 8), (0x00, 0x60)):
        transfer(pwm.device, 0x40, *data)
    pwm.clock.tick(1e7)
    assert pwm.edges == [(0.0, 0, True)]
    pwm.hz[0] = 4.096e6
    pwm.device.clock_changed()
    pwm.clock.tick(1e6)
    pwm.hz[0] = 0.0
    pwm.device.clock_changed()
    pwm.clock.tick(1e7)
    pwm.hz[0] = 4.096e6
    pwm.device.clock_changed()
    pwm.clock.tick(2e6)
    assert pwm.edges[1] == (pytest.approx(1e4 + 1e4 + 2500), 0, False)


def test_pca9685_always_on_always_off_and_round_the_wrap(pwm):
    transfer(pwm.device, 0x40, 0x00, 0x30)
    transfer(pwm.device, 0x40, 0x06, 0, 0x10, 0, 0, 0, 0x10, 0, 0x10, 0x00, 0x08, 0, 0)
    transfer(pwm.device, 0x40, 0x00, 0x20)
    assert [pwm.device.level(output) for output in range(3)] == [True, False, False]
    assert pwm.device.widths[:3] == [(0.0, 1.0), (0.0, 0.0), (0.5, 1.0)]
    pwm.clock.tick(pwm.device.period * 0.6e9)
    assert pwm.device.level(2)


def test_pca9685_keeps_its_prescaler_while_awake_and_resets_by_general_call(pwm):
    transfer(pwm.device, 0x40, 0x00, 0x20)
    transfer(pwm.device, 0x40, 0xFE, 9)
    assert register(pwm.device, 0xFE) == 0x1E
    assert transfer(pwm.device, 0x00, 0x06)
    assert register(pwm.device, 0x00) == 0x11
    pwm.device.silent = True
    assert not transfer(pwm.device, 0x40, 0x00)


# ---- TCA9548A and ABP2


def test_tca9548a_joins_what_its_register_says_and_hides_the_rest():
    switch, clock = Tca9548a(), SimulationClock()
    sensors = [Abp2(lambda p=p: p, lambda: clock.nanos) for p in (10e3, 20e3)]
    for channel, sensor in enumerate(sensors):
        switch.add(channel, sensor)
    assert not switch.start(0x28, False)
    for channel, pressure in enumerate((10e3, 20e3)):
        assert transfer(switch, 0x70, 1 << channel)
        assert switch.joined == 1 << channel
        assert transfer(switch, 0x28, 0xAA, 0, 0)
        clock.tick(5e6)
        assert switch.start(0x28, True)
        answer = bytes(switch.read() for _ in range(7))
        switch.stop()
        assert answer[0] == 0x40
        assert int.from_bytes(answer[1:4], "big") == pytest.approx((0.1 + 0.8 * pressure / 100e3) * 2**24, abs=1)


def test_abp2_is_busy_for_five_milliseconds_and_gives_the_last_result_meanwhile():
    clock, pressure = SimulationClock(), [50e3]
    sensor = Abp2(lambda: pressure[0], lambda: clock.nanos)

    def answer():
        assert sensor.start(0x28, True)
        data = bytes(sensor.read() for _ in range(4))
        sensor.stop()
        return data

    transfer(sensor, 0x28, 0xAA, 0, 0)
    assert answer() == b"\x60\0\0\0"
    pressure[0] = 0.0  # too late for the conversion that has begun
    clock.tick(5e6)
    assert answer() == bytes([0x40, 0x80, 0, 0])
    sensor.silent = True
    assert not sensor.start(0x28, True)


# ---- valves


def test_edges_move_the_plant_as_whole_periods_do():
    now = [0.0]
    one, other = (Plant(PlantParameters.nominal(2), seed=1) for _ in range(2))
    valves = Valves(one, lambda: now[0], lambda: 0.3)
    for bubble in range(2):
        valves.set(bubble, VENT, False)
    for fill, vent in ((3e-3, 0.0), (5e-3, 0.0), (0.0, 2e-3), (1.5e-3, 4e-3)):
        start = now[0]
        valves.set(0, FILL, fill > 0)
        valves.set(1, VENT, vent > 0)
        for until, bubble, valve in sorted([(fill, 0, FILL), (vent, 1, VENT)]):
            if 0 < until < 5e-3:
                now[0] = start + until
                valves.set(bubble, valve, False)
        now[0] = start + 5e-3
        valves.advance()
        other.advance(5e-3, [fill, 0.0], [0.0, vent], 0.3)
        assert one.time == other.time
        assert np.array_equal(one.height_mm, other.height_mm)
