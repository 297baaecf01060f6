"""Sequences on the host: their model, files, library, compiler and player."""
