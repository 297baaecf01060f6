"""What the board as a whole is doing: the states of `bubble_firmware.safety.state`."""

# What the board as a whole is doing: the states of `bubble_firmware.safety.state`.
IDLE, ACTIVE, HOLDING, BOOT, VENTING, FAULTED, STOPPED = range(7)
MODES = (
    (IDLE, "idle", "every vent valve is open, no bubble has pressure, nothing forbids a show"),
    (ACTIVE, "active", "heights are controlled"),
    (HOLDING, "holding", "all valves are closed and stay closed: STOP, or the host is silent"),
    (BOOT, "boot", "vented; the self-test is running or has not begun"),
    (VENTING, "venting", "every vent valve is open, the bubbles are on their way to no pressure"),
    (FAULTED, "faulted", "vented, SHOW is refused: a fault of the board stands that CLEAR has to acknowledge"),
    (STOPPED, "stopped", "vented, SHOW is refused: the emergency stop was pressed, CLEAR has to acknowledge it"),
)
