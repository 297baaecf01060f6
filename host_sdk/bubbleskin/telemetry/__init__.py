"""Telemetry: the stream, its fields, recordings."""
