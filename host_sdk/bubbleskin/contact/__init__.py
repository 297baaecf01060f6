"""Bubbles that touch: energy, equilibrium, the path that is followed, the fit."""
