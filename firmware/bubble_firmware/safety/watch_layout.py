"""Where each number stands that the fault monitor keeps: a row for every bubble, the board's limits, and what it says.

Device files repeat these names in regions that tools/generate/constants.py writes.
"""

from bubble_protocol.mpy_compat import const

# What has been found.
NEW_FAULT = const(1)
MOVING_BUBBLE = const(2)
PRESSED_BUBBLE = const(4)
OVERFILLED_BUBBLE = const(8)

# A row of a bubble.
FROZEN_TICKS = const(0)  # for which the sensor has said the same
FALL_PA = const(1)  # by which the pressure has fallen since the last tick
BUDGET_USED = const(2)  # Pa ticks
BUDGET_SPENT = const(3)  # whether it was used up and has not recovered
STALL_PA = const(4)  # where the pressure of the vented line last fell to
STALL_TICKS = const(5)  # since
INFLOW = const(6)  # whether air has come in that was not asked for
RESIDUAL_DEFICIT = const(7)  # µJ that were brought and are not there
RESIDUAL_SURPLUS = const(8)  # µJ that are there and were not brought
DELIVERED = const(9)  # µJ that have come in for sure since the last measurement
VENTED = const(10)  # µJ let out while there is surplus
DELIVERED_FLAT = const(11)  # µJ that have come in for sure, and still no pressure
DROPPED = const(12)  # whether the pressure has dropped as no valve makes it drop
LOW_PA = const(13)  # before a valve opened
HIGH_PA = const(14)
OPEN_TICKS = const(15)  # in a row with a valve open
NO_FLOW_TICKS = const(16)  # in a row of these without a sign of flow
CLOSED_PA = const(17)  # pressure of the closed line, when that was first compared
CLOSED_TICKS = const(18)  # since; from SETTLE_TICKS to 0 it settles
CLOSED_OFF_TICKS = const(19)  # in a row in which it was out of bounds
LOGGED_FAULTS = const(20)
# What control had decided before this tick, which is what the pressure of this tick tells of.
PREVIOUS_PA = const(21)
PREVIOUS_AIR = const(22)  # µJ, at the start of the last period; -1: not begun
PREVIOUS_STATUS = const(23)
PREVIOUS_IN_FLIGHT = const(24)
PREVIOUS_SETTLING_US = const(25)
PREVIOUS_FLOW = const(26)
PREVIOUS_FILL_US = const(27)
PREVIOUS_VENT_US = const(28)
EMPTYING_TICKS = const(29)  # for which it has been vented and still has the pressure of a filled bubble
MOVED_PA = const(30)  # from the pressure of the last line that was closed for a whole window to CLOSED_PA
WATCH_WORDS = const(31)

# The board's limits.
LOSS_MAX = const(0)  # µJ in a tick that may get lost
FROZEN_MAX = const(1)  # ticks
CLOSED_WINDOW = const(2)  # ticks for which a closed line is compared with its beginning
STALL_MAX = const(3)  # ticks in which a vented line must fall
FLOW_DUE = const(4)  # ticks after which an open valve must show flow
NO_FLOW_MAX = const(5)  # ticks
BUDGET_FREE_PA = const(6)  # pressure that costs no budget
BUDGET_MAX = const(7)  # Pa ticks
LIMIT_WORDS = const(8)

SETTLE_TICKS = const(-2)  # quiet ticks before a closed line is compared
