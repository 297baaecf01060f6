"""What can be set: (number, name, unit, least, most, default, meaning). None: the board's."""

# What can be set: (number, name, unit, least, most, default, meaning). None: the board's.
DEADMAN_HOLD, DEADMAN_VENT, BUDGET_KPA_S = range(3)
SETTINGS = (
    (
        DEADMAN_HOLD,
        "deadman_hold_ms",
        "ms",
        50,
        5000,
        250,
        "silence of the host after which bubbles that move are held",
    ),
    (
        DEADMAN_VENT,
        "deadman_vent_ms",
        "ms",
        100,
        60000,
        1000,
        "silence after which all are vented; not below the other",
    ),
    (
        BUDGET_KPA_S,
        "budget_kpa_s",
        "kPa s",
        10,
        None,
        None,
        "pressure above the board's threshold times time, for each bubble",
    ),
)
