"""A wristband that measures itself: what is played to find out, and the model of a bubble that is fitted to what it tells.

The model shares no function and no constant with the simulated plants, the tables' membrane and the firmware, so that a plant
may well be another than is believed here.
"""
