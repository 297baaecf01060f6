"""The wire: framing, message schema, version. Pure: no I/O, no clock, the same files on host and device."""
