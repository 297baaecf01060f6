"""Where the tables, trim and settings in use came from, and what one slot of the store holds."""

# Where the tables, trim and settings in use at boot came from.
FACTORY, SLOT_A, SLOT_B, DAMAGED, FOREIGN, NO_STORE = range(6)
SOURCES = (
    (FACTORY, "factory", "nothing is stored: what the firmware was made with"),
    (SLOT_A, "slot_a", "the first slot"),
    (SLOT_B, "slot_b", "the second slot"),
    (DAMAGED, "damaged", "something was stored and cannot be used: what the firmware was made with"),
    (FOREIGN, "foreign", "newer firmware or another board has stored something: what the firmware was made with"),
    (NO_STORE, "none", "this board has no store: what the firmware was made with"),
)

# What one slot of the store holds.
SLOT_BLANK, SLOT_VALID, SLOT_CORRUPT, SLOT_FOREIGN, SLOT_REJECTED = range(5)
SLOTS = (
    (SLOT_BLANK, "blank", "nothing, or a save that was cut short"),
    (SLOT_VALID, "valid", "a record whose CRC is right"),
    (SLOT_CORRUPT, "corrupt", "no whole record: a save was cut short, or flash has lost bits"),
    (SLOT_FOREIGN, "foreign", "a record of newer firmware or of another board: left alone"),
    (SLOT_REJECTED, "rejected", "a whole record that the board's limits do not allow"),
)
