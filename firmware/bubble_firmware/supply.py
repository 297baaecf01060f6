"""The reservoir: its pressure, how hard the pump works to keep it, and whether it is lost."""

_DUTY_PER_PA = 32  # full duty of 65535 at 2 kPa below the setpoint
_HEADROOM_PA = 500  # the proportional droop at rest, so that the reservoir stands at its nominal pressure
_PATIENCE_US = 5000000  # an empty reservoir is full in two seconds


class Supply:
    """`pressure_pa` is measured, `pump` (0 to 65535) and `dump` are what to do about it; `lost`: it does not help."""

    def __init__(self, board):
        self.pressure_pa = 0
        self.pump = 0
        self.dump = False
        self.lost = False
        self._board = board
        self._first = True
        self._low = 0
        self._patience = _PATIENCE_US // board.TICK_US

    def sense(self, count):
        """Take one reading of the supply sensor. A sensor at the end of its range stops the pump."""
        board = self._board
        if count <= board.COUNT_LOW or count >= board.COUNT_HIGH:
            self.pump = 0
            self._lack()
            return
        pressure = (count - board.SUPPLY_ZERO) * board.SUPPLY_PA_PER_COUNT
        if self._first:
            self._first = False
            self.pressure_pa = pressure
        self.pressure_pa += (pressure - self.pressure_pa) // 4  # four readings average the noise away
        duty = (board.SUPPLY_PA + _HEADROOM_PA - self.pressure_pa) * _DUTY_PER_PA
        self.pump = 0 if duty < 0 else 65535 if duty > 65535 else duty
        self.dump = self.pressure_pa > board.SUPPLY_MAX_PA
        if self.pressure_pa < board.SUPPLY_LOW_PA:
            self._lack()
        else:
            self._low = 0
            self.lost = False

    def clear(self):
        """Wait afresh before the supply is called lost."""
        self._low = 0
        self.lost = False

    def _lack(self):
        if self._low < self._patience:
            self._low += 1
        else:
            self.lost = True
