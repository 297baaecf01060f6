"""Versions: of the protocol (who understands whom) and of the firmware that ships with it."""

PROTOCOL_MIN = 2  # the oldest protocol this side still speaks
PROTOCOL_MAX = 2  # the newest
FIRMWARE = (0, 1, 0)
