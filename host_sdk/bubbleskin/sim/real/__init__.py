"""Bubbles and air as they are: rubber with a memory, gas that warms and cools, sides that push.

Derived and written for itself: nothing here, and nothing that it imports, comes from the tables, the planner, the contact model
or the firmware, so that what these believe can be wrong. `docs/simulator.md` says what is modelled.
"""
