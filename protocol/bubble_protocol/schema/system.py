"""What a device can do, how its time wraps, and what RESTART leads to."""

# Bits of `capabilities`.
DELIVERY, SAFETY, STORE, CAN_SEQUENCES, CAN_CHOOSE_TELEMETRY, CAN_TELL_LAYOUT, CAN_ESTIMATE = 1, 2, 4, 8, 16, 32, 64
CAPABILITIES = (
    (DELIVERY, "delivery", "sessions, a window, replies kept: every request counts once"),
    (SAFETY, "safety", "a deadman, a fault log, settings"),
    (STORE, "store", "tables, settings and figures can be stored"),
    (CAN_SEQUENCES, "sequences", "sequences are played on the device's own clock"),
    (CAN_CHOOSE_TELEMETRY, "telemetry_fields", "SUBSCRIBE_FIELDS: telemetry of chosen columns"),
    (CAN_TELL_LAYOUT, "layout", "LAYOUT: where its bubbles are"),
    (CAN_ESTIMATE, "estimate", "ESTIMATE, CALIBRATION: how well heights are known, and figures of both valves"),
)

TICKS_WRAP = 1 << 30  # device time counts up to here and goes on from 0: after 62 days at 5 ms. No integer becomes long

# By the device, twice its window: STOP and VENT may be so far ahead of the oldest request without an answer.
REPLIES_KEPT = 16

# What RESTART leads to.
FIRMWARE, BOOT_LOADER, PROMPT = range(3)
RESTARTS = (
    (FIRMWARE, "firmware", "the firmware from its beginning"),
    (BOOT_LOADER, "boot_loader", "the chip's USB drive that takes a UF2"),
    (PROMPT, "prompt", "MicroPython's prompt"),
)
