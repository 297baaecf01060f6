"""Digital buttons: the middle bubble switches a lamp, the ring around it sets how bright it is."""

import sys

import bubbleskin as bs
from bubbleskin.demonstrations.buttons import Buttons

with bs.connect(sys.argv[1] if len(sys.argv) > 1 else "sim://wristband7") as skin:
    buttons = Buttons.on(skin)
    buttons.on_press(0, lambda bubble: print("lamp on"))
    for bubble in skin.layout.neighbours[0]:
        buttons.on_press(bubble, lambda bubble: print(f"brightness {bubble} of 6"))
    buttons.hover(0)  # where a pointer would be: the bubble peeks out
    skin.sleep(0.5)
    buttons.press(0)
    skin.sleep(0.5)
    for bubble in (1, 2, 3):  # a pointer that is drawn over them
        buttons.drag(bubble)
        skin.sleep(0.3)
    print(f"{skin.layout.names(sorted(buttons.raised))} are up")
