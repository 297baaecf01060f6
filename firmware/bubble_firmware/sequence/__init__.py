"""Sequences on the device: their memory and what plays them."""
