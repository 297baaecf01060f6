"""Versions: of the protocol (who understands whom) and of the firmware that ships with it."""

PROTOCOL_MIN = 1  # the oldest protocol this side still speaks
PROTOCOL_MAX = 1  # the newest
FIRMWARE = (0, 1, 0)
