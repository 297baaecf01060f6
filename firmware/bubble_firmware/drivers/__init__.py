"""Chips: one module each. They take registers or a bus, preallocate, and never raise in the tick."""
