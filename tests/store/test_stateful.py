"""The store against a model, in any order of saves, cuts, resets, reboots and bits that rot."""

import contextlib
import random

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, precondition, rule, run_state_machine_as_test

from bubble_protocol.schema import store
from bubbleskin.sim.flash import NorFlash, PowerCut

SEEDS = st.integers(0, 2**32 - 1)


def torn(seed, share):
    """Any subset of the bits; of an erase also anything at all."""
    chance = random.Random(seed)

    def remains(before, after):
        if len(before) > 256 and seed % 3 == 0:
            return chance.randbytes(len(before))
        masks = (sum((chance.random() < share) << bit for bit in range(8)) for _ in before)
        return bytes(b ^ ((b ^ a) & mask) for b, a, mask in zip(before, after, masks, strict=True))

    return remains


class StoreMachine(RuleBasedStateMachine):
    """`stored`: what a boot must find; `second`: what it may find instead once that has rotted."""

    kit = None
    """The small board whose store it is."""

    def __init__(self):
        super().__init__()
        self.flash = NorFlash()
        self.device = self.kit.Device(self.flash)
        self.number = 0
        self.stored = self.kit.FACTORY_CONTENT
        self.second = [self.kit.FACTORY_CONTENT]
        self.rotten = set()

    def boot(self, *allowed):
        self.device = self.kit.Device(self.flash)
        found = self.device.content
        assert found in allowed
        assert self.device.store.source != store.FOREIGN
        return found

    def take(self, content):
        if content != self.stored:
            self.second = [self.stored]
            self.stored = content

    @rule()
    def change(self):
        self.number += 1
        self.device.change(self.number)

    @rule()
    def save(self):
        assert self.device.store.save()
        self.take(self.device.content)

    @rule()
    def reset(self):
        assert self.device.store.reset()
        assert self.device.content == self.kit.FACTORY_CONTENT
        self.stored, self.second = self.kit.FACTORY_CONTENT, [self.kit.FACTORY_CONTENT]

    @rule()
    def reboot(self):
        self.boot(self.stored)

    @rule(after=st.integers(0, 3), seed=SEEDS, share=st.sampled_from([0, 0.01, 0.3, 0.7, 0.99, 1]))
    def save_cut_short(self, after, seed, share):
        self.flash.cut(after, torn(seed, share))
        new = self.device.content
        try:
            assert self.device.store.save()
        except PowerCut:
            pass
        else:
            self.flash.cut(-1, torn(seed, share))
            self.take(new)
        old, second = self.stored, self.second
        found = self.boot(old, new)
        if found == old != new:
            self.second = [*second, self.kit.FACTORY_CONTENT]  # the other slot may be gone
        else:
            self.take(found)

    @rule(after=st.integers(0, 3), seed=SEEDS, share=st.sampled_from([0, 0.01, 0.3, 0.7, 0.99, 1]))
    def reset_cut_short(self, after, seed, share):
        self.flash.cut(after, torn(seed, share))
        with contextlib.suppress(PowerCut):
            assert self.device.store.reset()
        self.flash.cut(-1, torn(seed, share))
        old, second = self.stored, self.second
        found = self.boot(old, self.kit.FACTORY_CONTENT)
        self.stored = found
        self.second = [*second, old, self.kit.FACTORY_CONTENT]

    @precondition(lambda self: self.device.store.length)
    @rule(seed=SEEDS, bits=st.integers(1, 3))
    def rot_in_use(self, seed, bits):
        self.rot(self.device.store.source == store.SLOT_B, seed, bits)
        self.stored = self.boot(*self.second)
        self.second = [self.kit.FACTORY_CONTENT]

    @precondition(lambda self: self.device.store.source in (store.SLOT_A, store.SLOT_B))
    @rule(seed=SEEDS, bits=st.integers(1, 3))
    def rot_of_the_other(self, seed, bits):
        self.rot(self.device.store.source == store.SLOT_A, seed, bits)
        self.boot(self.stored)
        self.second = [*self.second, self.kit.FACTORY_CONTENT]

    def rot(self, slot, seed, bits):
        """Up to three bits, which a CRC-32 always notices; not where it would only be noticed by its absence.

        A bit rots once: if it rotted back, the record would be whole again, and a boot right to find it.
        """
        chance = random.Random(seed)
        start = slot * self.flash.size // 2
        sound = [bit for bit in range(8 * 44) if (slot, bit) not in self.rotten]
        for bit in chance.sample(sound, bits):
            self.rotten.add((slot, bit))
            self.flash.image[start + bit // 8] ^= 1 << bit % 8


def machine(kit):
    """The rules, on the small board of `kit`."""
    return type("StoreMachine", (StoreMachine,), {"kit": kit})


@pytest.mark.promise("whole-or-old")
@pytest.mark.medium
@pytest.mark.parametrize("examples", [10, pytest.param(200, marks=pytest.mark.slow)])
def test_any_history_leaves_one_whole_record(kit, examples):
    run_state_machine_as_test(
        machine(kit),
        settings=settings(max_examples=examples, stateful_step_count=25, suppress_health_check=[HealthCheck.too_slow]),
    )
