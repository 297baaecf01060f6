"""`bubbleskin flash`: firmware onto boards, so that an interruption at any point is mended by the next time."""

from bubbleskin.flash.machine import Machine, ThisMachine
from bubbleskin.flash.order import Order, Outcome
from bubbleskin.flash.update import flash

__all__ = ["Machine", "Order", "Outcome", "ThisMachine", "flash"]
