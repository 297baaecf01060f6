"""The reservoir: its pressure, and how hard the pump works to keep it."""

_DUTY_PER_PA = 32  # full duty of 65535 at 2 kPa below the setpoint
_HEADROOM_PA = 500  # the proportional droop at rest, so that the reservoir stands at its nominal pressure


class Supply:
    """`pressure_pa` is measured, `pump` (0 to 65535) and `dump` are what to do about it."""

    def __init__(self, board):
        self.pressure_pa = 0
        self.pump = 0
        self.dump = False
        self._board = board
        self._first = True

    def sense(self, count):
        """Take one reading of the supply sensor. A sensor at the end of its range stops the pump."""
        board = self._board
        if count <= board.COUNT_LOW or count >= board.COUNT_HIGH:
            self.pump = 0
            return
        pressure = (count - board.SUPPLY_ZERO) * board.SUPPLY_PA_PER_COUNT
        if self._first:
            self._first = False
            self.pressure_pa = pressure
        self.pressure_pa += (pressure - self.pressure_pa) // 4  # four readings average the noise away
        duty = (board.SUPPLY_PA + _HEADROOM_PA - self.pressure_pa) * _DUTY_PER_PA
        self.pump = 0 if duty < 0 else 65535 if duty > 65535 else duty
        self.dump = self.pressure_pa > board.SUPPLY_MAX_PA
