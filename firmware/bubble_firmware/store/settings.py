# mypy: disable-error-code="arg-type"
"""What can be set over the wire, within the limits of the board. The schema lists it."""

from array import array

from bubble_protocol.schema.settings import BUDGET_KPA_S, DEADMAN_HOLD, DEADMAN_VENT, SETTINGS


class Settings:
    """`values` in use, one per setting; `lows` and `highs` are the hard limits; `version` counts changes since boot."""

    def __init__(self, board):
        self.count = len(SETTINGS)
        self.values = array("i")
        self.lows = array("i")
        self.highs = array("i")
        self.version = 0
        for number, _, _, low, high, default, _ in SETTINGS:
            most = board.BUDGET_KPA_S if number == BUDGET_KPA_S else high
            self.lows.append(low)
            self.highs.append(most)
            self.values.append(most if default is None else default)
        self.wanted = array("i", self.values)

    def flaw(self, values, at, count):
        """Index of the first of `count` pairs (setting, value) in `values[at:]` that is not allowed, -1 where all are.

        What they would lead to stands ready for `use` then.
        """
        wanted = self.wanted
        for number in range(self.count):
            wanted[number] = self.values[number]
        for index in range(count):
            number = values[at + 2 * index]
            value = values[at + 2 * index + 1]
            if number >= self.count or not self.lows[number] <= value <= self.highs[number]:
                return index
            wanted[number] = value
        if wanted[DEADMAN_VENT] < wanted[DEADMAN_HOLD]:
            return count
        return -1

    def use(self):
        """Take up what `flaw` has found good."""
        for number in range(self.count):
            self.values[number] = self.wanted[number]
        self.version = self.version + 1 & 0xFFFFFF
