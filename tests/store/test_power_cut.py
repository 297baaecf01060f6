"""Power fails at every single erase and page of a commit, and leaves of it whatever flash may: old or new, never a mix."""

import random

import pytest

from bubble_protocol.schema import store
from bubbleskin.sim.flash import PAGE, SECTOR, NorFlash, PowerCut

# Operations are issued one by one by one thread, each waits until the chip is done, and the chip does one at a time: what
# order is left to it is that of the bits within one operation. So every operation, and every kind of subset of its bits.


def subset(mask):
    """Of the bits that would have changed, those in `mask` have."""

    def remains(before, after):
        return bytes(b ^ ((b ^ a) & m) for b, a, m in zip(before, after, mask(len(before)), strict=True))

    return remains


def some_bits(seed, share):
    def mask(size):
        chance = random.Random(f"{seed} {share} {size}")
        return bytes(sum((chance.random() < share) << bit for bit in range(8)) for _ in range(size))

    return subset(mask)


def bytes_of(first, last):
    return subset(lambda size: bytes(255 * (first <= at < last) for at in range(size)))


def but_one_bit(at):
    return subset(
        lambda size: bytes(255 - (at % 8 == 0) * (1 << at // 8 % 8) * (index == at // 64) for index in range(size))
    )


COMMON = [
    bytes_of(0, 0),
    bytes_of(0, SECTOR),
    *(some_bits(seed, share) for seed in range(2) for share in (0.02, 0.5, 0.98)),
    subset(lambda size: b"\xaa" * size),
    subset(lambda size: b"\x0f" * size),
    bytes_of(0, 40),
    bytes_of(40, SECTOR),
]
PROGRAM = [*COMMON, *(bytes_of(0, at) for at in (1, 4, 6, 8, 20, 36, 39, 41, 44, 128, 255))]
ERASE = [
    *COMMON,
    *(bytes_of(0, at) for at in (PAGE, SECTOR // 2, SECTOR - 1)),
    *(bytes_of(at, SECTOR) for at in (PAGE, SECTOR // 2)),
    # Chips clear a sector before they set it: what is left can be anything.
    lambda before, after: bytes(len(before)),
    lambda before, after: random.Random(1).randbytes(len(before)),
    lambda before, after: bytes(PAGE) + before[PAGE:],
    lambda before, after: before[:PAGE] + bytes(len(before) - PAGE),
]
EVERY_BYTE = [bytes_of(0, at) for at in range(PAGE + 1)] + [bytes_of(at, PAGE) for at in range(PAGE + 1)]


class Watched(NorFlash):
    """Flash that notes what its operations are."""

    def __init__(self, size):
        super().__init__(size)
        self.kinds = []

    def erase(self, offset):
        self.kinds.append(("erase", offset))
        super().erase(offset)

    def program(self, offset, page):
        self.kinds.append(("program", offset))
        super().program(offset, page)


def copy(flash):
    twin = Watched(flash.size)
    twin.image[:] = flash.image
    return twin


def histories(kit, data, saves, generation):
    """Flash as it is after so many saves, the first of which has this generation; what is then in use."""
    flash = NorFlash()
    if saves:
        device = kit.Device(NorFlash(), data)
        first = kit.make_record(kit.sections_of(device.change(100)).values(), generation, name=data.NAME)
        flash = kit.flash_with(first)
    for number in range(1, saves):
        device = kit.Device(flash, data)
        device.change(100 + number)
        assert device.store.save()
    return flash


def cut_everywhere(kit, flash, data, commit, program, erase):
    """Cut `commit(device)` at each of its operations in each way; how many cuts left old and new."""
    old = kit.Device(flash, data).content
    whole = copy(flash)
    device = kit.Device(whole, data)
    commit(device)
    new = device.content
    assert new != old
    assert kit.Device(whole, data).content == new
    count = {"old": 0, "new": 0}
    for number, (kind, offset) in enumerate(whole.kinds):
        for remains in program if kind == "program" else erase:
            torn = copy(flash)
            device = kit.Device(torn, data)
            torn.cut(number, remains)
            with pytest.raises(PowerCut):
                commit(device)
            again = kit.Device(torn, data)
            found = again.content
            assert found in (old, new), f"a mix after {kind} at {offset}"
            count["old" if found == old else "new"] += 1
            # And it goes on from there, as if nothing had been.
            last = again.change(999)
            assert again.store.save()
            assert kit.Device(torn, data).content == last
    print(
        f"{len(whole.kinds)} operations, {sum(count.values())} cuts: {count['old']} left old, {count['new']} left new"
    )
    return count


def save(device):
    device.change(500)
    assert device.store.save()


def reset(device):
    assert device.store.reset()


MORE = [(3, 1), (2, 65534), (2, 65535)]


@pytest.mark.promise("whole-or-old")
@pytest.mark.medium
@pytest.mark.parametrize(
    ("saves", "generation"),
    [(0, 1), (1, 1), (2, 1), (3, 65534), *(pytest.param(*history, marks=pytest.mark.slow) for history in MORE)],
)
def test_a_save_cut_short_leaves_old_or_new(kit, saves, generation):
    data = kit.board(bubbles=1)
    count = cut_everywhere(kit, histories(kit, data, saves, generation), data, save, PROGRAM, ERASE)
    assert count["old"] > 20
    assert count["new"] >= 1, "a cut after the last bit of the header"


@pytest.mark.promise("whole-or-old")
@pytest.mark.medium
@pytest.mark.parametrize("saves", [1, 2])
def test_a_reset_cut_short_leaves_old_or_factory(kit, saves):
    data = kit.board(bubbles=1)
    count = cut_everywhere(kit, histories(kit, data, saves, 1), data, reset, PROGRAM, ERASE)
    assert count["old"] > 10
    assert count["new"] > 10, "whatever is cut of the second slot"


@pytest.mark.promise("whole-or-old")
@pytest.mark.slow
@pytest.mark.parametrize(("saves", "generation"), [(0, 1), (1, 1), (2, 65535)])
def test_at_every_byte_and_bit_of_every_page(kit, saves, generation):
    data = kit.board(bubbles=1)
    bits = [but_one_bit(at) for at in range(0, 8 * PAGE, 7)]
    cut_everywhere(kit, histories(kit, data, saves, generation), data, save, [*PROGRAM, *EVERY_BYTE, *bits], ERASE)


@pytest.mark.slow
@pytest.mark.parametrize("saves", [1, 2])
def test_with_records_of_more_than_a_sector(kit, saves):
    data = kit.board("wristband19")
    flash = NorFlash()
    for number in range(saves):
        device = kit.Device(flash, data)
        device.change(42 + number)
        assert device.store.save()
    assert flash.erases[1] == 1, "two sectors a slot"

    def commit(device):
        device.change(42 + saves)
        assert device.store.save()

    cut_everywhere(kit, flash, data, commit, PROGRAM[:6], ERASE)


def test_until_the_last_page_there_is_nothing_that_looks_like_a_record(kit):
    """So nothing but the cut of that one page relies on the CRC."""
    data = kit.board("wristband19")
    flash = histories(kit, data, 2, 1)
    whole = copy(flash)

    def save(device):
        device.change(44)
        assert device.store.save()

    save(kit.Device(whole, data))
    assert whole.kinds[-1] == ("program", 0)
    assert [kind for kind, _ in whole.kinds[:3]] == ["erase", "erase", "program"]
    for number in range(1, len(whole.kinds)):
        torn = copy(flash)
        device = kit.Device(torn, data)
        torn.cut(number, bytes_of(0, 0))
        with pytest.raises(PowerCut):
            save(device)
        assert kit.Device(torn, data).store.states[0] == store.SLOT_BLANK
