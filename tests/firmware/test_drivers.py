"""Drivers against the bits of their chips' data sheets: registers and buses that do what the sheet says, in a few lines."""

from array import array

import pytest

from bubble_firmware import boards
from bubble_firmware.drivers import clock, mcp3208, pca9685, pwm
from bubble_firmware.drivers.abp2 import Abp2
from bubble_firmware.drivers.tca9548a import Tca9548a
from bubble_firmware.hal.base import ABSENT

# ---- PWM


def test_all_slices_start_in_one_write_with_every_valve_safe():
    block = [0] * 44
    pwm.start(block, 7, 5000, 125)
    for at in range(0, 35, 5):
        csr, div, counter, compare, top = block[at : at + 5]
        assert csr == 0b1000, "channel B inverted, not yet enabled by itself"
        assert (div / 16, counter, top) == (125, 0, 4999)
        assert (compare & 0xFFFF, compare >> 16) == (0, 5000), "fill never energised, vent never either"
    assert block[40] == 0xFF


def test_a_pulse_is_written_as_it_is():
    block = [0] * 44
    pwm.write(block, array("H", [0, 5000, 1500, 0, 5000, 0]), 3, 65535)
    assert [(block[at] & 0xFFFF, block[at] >> 16) for at in (3, 8, 13)] == [(0, 5000), (1500, 0), (5000, 0)]
    assert block[38] == 6250, "the pump's compare value"
    pwm.vent(block, 3, 5000)
    assert block[38] == 0
    assert [(block[at] & 0xFFFF, block[at] >> 16) for at in (3, 8, 13)] == [(0, 5000)] * 3


@pytest.mark.parametrize(("duty", "compare"), [(0, 0), (65535, 6250), (32768, 3125)])
def test_the_pump_reaches_both_ends(duty, compare):
    block = [0] * 44
    pwm.write(block, array("H", [0, 0]), 1, duty)
    assert block[7 * 5 + 3] == compare


def test_a_wrap_is_told_once():
    class Block(list):
        def __setitem__(self, index, value):  # INTR is cleared by writing ones
            super().__setitem__(index, self[index] & ~value if index == 41 else value)

    block = Block([0] * 44)
    assert not pwm.wrapped(block)
    list.__setitem__(block, 41, 0x7F)
    assert pwm.wrapped(block)
    assert not pwm.wrapped(block)


# ---- MCP3208


class Spi:
    """The registers of a PL022 whose transfers are over at once, and of the GPIO with the chip select of `chip`."""

    def __init__(self, chip):
        self._chip = chip
        self._received = []

    def __getitem__(self, word):
        if word == 3:
            return 4 if self._received else 0  # not busy; receive FIFO not empty
        assert word == 2
        return self._received.pop(0) if self._received else 0

    def __setitem__(self, word, value):
        assert word == 2
        assert 0 <= value <= 255
        assert len(self._received) < 8
        self._received.append(self._chip(value))


class Gpio:
    def __init__(self, select):
        self._select = select

    def __setitem__(self, word, mask):
        self._select(mask, word == 5)


class Mcp3208:
    """DS21298E, figure 6-1: bits in, bits out; the line is pulled up while the chip does not drive it."""

    def __init__(self, counts, pin):
        self._counts = counts
        self._mask = 1 << pin
        self._bits = None

    def select(self, mask, high):
        assert mask == self._mask
        self._bits = None if high else []

    def exchange(self, byte):
        out = 0
        for place in range(7, -1, -1):
            out = out << 1 | self._clock(byte >> place & 1)
        return out

    def _clock(self, bit):
        if self._bits is None:
            return 1
        if not self._bits and not bit:
            return 1  # leading zeros
        self._bits.append(bit)
        k = len(self._bits)  # 1: start, 2: single-ended, 3 to 5: channel, 6: sample, 7: null, 8 to 19: the answer
        if k < 7:
            return 1
        if k == 7:
            return 0
        _, single, *rest = self._bits[:5]
        assert single
        channel = rest[0] << 2 | rest[1] << 1 | rest[2]
        return self._counts[channel] >> (19 - k) & 1 if k <= 19 else 0


def test_every_channel_and_every_bit_arrives():
    values = [0, 4095, 0x555, 0xAAA, 1, 2048, 160, 0x123]
    chip = Mcp3208(values, 17)
    counts = array("H", bytes(20))
    assert mcp3208.read(Spi(chip.exchange), Gpio(chip.select), 17, 8, counts, 1) == 8
    assert counts.tolist() == [0, *values, 0]


def test_a_missing_converter_is_told_from_any_count():
    counts = array("H", bytes(16))
    assert mcp3208.read(Spi(lambda byte: 0xFF), Gpio(lambda mask, high: None), 17, 8, counts, 0) == 0
    assert counts.tolist() == [ABSENT] * 8


# ---- I2C


class Bus:
    """A bus with `chips` by address; a write to another raises, as `machine.I2C` does."""

    def __init__(self, **chips):
        self.chips = {int(name[1:], 16): chip for name, chip in chips.items()}

    def _at(self, address):
        if address not in self.chips:
            raise OSError(5)
        return self.chips[address]

    def writeto(self, address, data):
        self._at(address).write(bytes(data))

    def readfrom_into(self, address, buffer):
        buffer[:] = self._at(address).read(len(buffer))


class Pca9685:
    """NXP PCA9685 rev. 4: registers, auto-increment, and what its outputs do in a period."""

    def __init__(self):
        self.registers = bytearray(256)
        self.registers[0] = 0x11  # after power-on: asleep, all-call
        self._at = 0

    def write(self, data):
        self._at, values = data[0], data[1:]
        for value in values:
            if self._at == 0xFE:
                assert self.registers[0] & 0x10, "PRE_SCALE can only be written asleep"
            if self._at == 0:
                value |= self.registers[0] & 0x40  # EXTCLK stays
                assert not value & 0x40 or self.registers[0] & 0x10 or self.registers[0] & 0x40
            self.registers[self._at] = value
            if self.registers[0] & 0x20:
                self._at += 1

    def read(self, size):
        assert size == 1
        return self.registers[self._at : self._at + 1]

    def high(self, output):
        """Counts for which an output is high in a period, as a set."""
        on_low, on_high, off_low, off_high = self.registers[6 + 4 * output : 10 + 4 * output]
        if off_high & 16:
            return set()
        if on_high & 16:
            return set(range(4096))
        on, off = on_high << 8 | on_low, off_high << 8 | off_low
        return set(range(on, off)) if on < off else set(range(4096)) - set(range(off, on))


@pytest.fixture
def expander():
    chip = Pca9685()
    bus = Bus(x41=chip)
    driver = pca9685.Pca9685(bus, 0x41, 7, 6, 10000)
    driver.start()
    driver.wake()
    return chip, bus, driver


def test_the_expander_is_set_up_for_the_ticks_clock(expander):
    chip, _, driver = expander
    assert not driver.missing
    assert chip.registers[0] == 0x60, "awake, external clock, auto-increment"
    assert chip.registers[0xFE] + 1 == pca9685.CLOCKS // 4096
    assert chip.registers[1] == 0x04, "totem pole, outputs low while /OE is high"


@pytest.mark.parametrize("width", [0, 1, 1500, 5000, 9999, 10000])
def test_widths_come_out_of_the_expander(expander, width):
    chip, _, driver = expander
    pulses = array("H", [7] * 38)
    pulses[14], pulses[15] = width, width  # bubble 7 is this chip's first
    driver.write(pulses, False)
    counts = round(width * 4096 / 10000)
    assert chip.high(0) == set(range(counts)), "fill: energised from the start"
    assert chip.high(1) == set(range(counts, 4096)), "vent: left open from the start, energised after"
    assert chip.high(11) == set(range(3, 4096))


def test_what_has_not_changed_is_only_sent_again_when_asked(expander):
    chip, _, driver = expander
    pulses = array("H", [1500] * 38)
    driver.write(pulses, False)
    chip.registers[6:70] = bytes(64)
    driver.write(pulses, False)
    assert not any(chip.registers[6:70])
    driver.write(pulses, True)
    assert sum(map(any, zip(*[iter(chip.registers[6:54])] * 8, strict=True))) == 1, "one bubble at a time"
    for _ in range(5):
        driver.write(pulses, True)
    assert all(map(any, zip(*[iter(chip.registers[6:54])] * 8, strict=True))), "in the end all six"


@pytest.mark.parametrize("bubbles", [(7,), (9, 12), (7, 8, 12)])
def test_what_has_changed_is_sent_and_nothing_else(expander, bubbles):
    chip, _, driver = expander
    pulses = array("H", [1500] * 38)
    driver.write(pulses, False)
    sent = bytearray(chip.registers)
    written = []
    chip.write, write = lambda data: (written.append(data), write(data)), chip.write
    for bubble in bubbles:
        pulses[2 * bubble] = 2500
    driver.write(pulses, False)
    changed = {at for at in range(256) if chip.registers[at] != sent[at]}
    assert {(at - 6) // 8 + 7 for at in changed} == set(bubbles)
    assert sum(map(len, written)) == (9 * len(bubbles) if len(bubbles) < 3 else 49)


def test_a_driver_that_starts_again_sends_everything(expander):
    chip, _, driver = expander
    pulses = array("H", [1500] * 38)
    driver.write(pulses, False)
    chip.registers[6:54] = bytes(48)
    driver.start()
    driver.write(pulses, False)
    assert all(map(any, zip(*[iter(chip.registers[6:54])] * 8, strict=True)))


def test_an_expander_that_does_not_answer_is_left_alone_until_started(expander):
    chip, bus, driver = expander
    pulses = array("H", bytes(76))
    del bus.chips[0x41]
    driver.write(pulses, False)
    assert driver.missing
    bus.chips[0x41] = chip
    driver.write(pulses, False)
    driver.check()
    assert driver.missing
    driver.start()
    driver.wake()
    driver.check()
    assert not driver.missing


def test_an_expander_that_has_lost_its_power_is_found(expander):
    chip, _, driver = expander
    driver.check()
    assert not driver.missing
    chip.registers[0] = 0x11
    driver.check()
    assert driver.missing


@pytest.mark.parametrize("name", ["wristband7", "wristband19"])
def test_the_expanders_period_is_exactly_the_tick(name):
    board = boards.load(name)
    divide = clock.divider(125, board.TICK_US, pca9685.CLOCKS) if board.VALVES == "pca9685" else 256
    if board.VALVES == "pca9685":
        assert pca9685.CLOCKS * divide / 256 / 125 == board.TICK_US
    block = [1, 1]
    clock.start(divide, block)
    assert block[0] == 6 << 5 | 1 << 11 | 1 << 12
    assert block[1] == divide
    clock.stop(block)
    assert not block[0] & 1 << 11


class Abp2Chips:
    """ABP2 sensors behind a TCA9548A: one address, each heard where its channel is selected."""

    def __init__(self, raw):
        self.raw = list(raw)
        self._begun = [None] * len(raw)
        self.mask = 0

    def switch(self):
        chips = self

        class Switch:
            def write(self, data):
                (chips.mask,) = data

        return Switch()

    def _selected(self):
        chosen = [i for i, raw in enumerate(self.raw) if self.mask >> i & 1 and raw is not None]
        if not chosen:
            raise OSError(5)
        return chosen

    def write(self, data):
        assert data == b"\xaa\x00\x00"
        for i in self._selected():
            self._begun[i] = self.raw[i]

    def read(self, size):
        assert size == 4
        (one,) = self._selected()
        return b"\x40" + self._begun[one].to_bytes(3, "big")


def test_digital_sensors_read_as_a_converter_would():
    span = 0.8 * 2**24
    chips = Abp2Chips([round(0.1 * 2**24 + span * pa / 100e3) for pa in (0, 17, 20000, 60000)])
    bus = Bus(x28=chips, x70=chips.switch())
    sensors = Abp2(bus, Tca9548a(bus), 4, 100000, 160, 17)
    counts = array("H", bytes(8))
    assert sensors.read(counts, 0) == 0, "nothing was started yet"
    assert sensors.read(counts, 0) == 4
    assert counts.tolist() == pytest.approx([160, 161, 160 + 20000 / 17, 160 + 60000 / 17], abs=1)


def test_a_missing_digital_sensor_is_one_missing_sensor():
    chips = Abp2Chips([5000000, None, 5000000])
    bus = Bus(x28=chips, x70=chips.switch())
    sensors = Abp2(bus, Tca9548a(bus), 3, 100000, 160, 17)
    counts = array("H", bytes(6))
    sensors.read(counts, 0)
    assert sensors.read(counts, 0) == 2
    assert counts[1] == ABSENT
    assert counts[0] == counts[2] != ABSENT


def test_without_the_switch_every_sensor_is_missing_and_comes_back():
    chips = Abp2Chips([5000000] * 2)
    switch = chips.switch()
    bus = Bus(x28=chips, x70=switch)
    sensors = Abp2(bus, Tca9548a(bus), 2, 100000, 160, 17)
    counts = array("H", bytes(4))
    sensors.read(counts, 0)
    del bus.chips[0x70]
    assert sensors.read(counts, 0) == 0
    assert counts.tolist() == [ABSENT] * 2
    bus.chips[0x70] = switch
    assert any(sensors.read(counts, 0) == 2 for _ in range(1000))
