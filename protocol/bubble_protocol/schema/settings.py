"""What can be set: (number, name, unit, least, most, default, meaning). None: the board's."""

# What can be set: (number, name, unit, least, most, default, meaning). None: the board's.
DEADMAN_HOLD, DEADMAN_VENT, BUDGET_KPA_S, ATMOSPHERE_PA, REZERO_UM = range(5)
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
    (
        ATMOSPHERE_PA,
        "atmosphere_pa",
        "Pa",
        60000,
        110000,
        101325,
        "pressure of the air around, which heights are reckoned with",
    ),
    (
        REZERO_UM,
        "rezero_um",
        "µm",
        0,
        5000,
        250,
        "standard deviation of its height from which a bubble is emptied before it goes elsewhere; 0: never",
    ),
)
