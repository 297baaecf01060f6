"""The device's end of the link: frames in, turns kept, replies and telemetry out."""
