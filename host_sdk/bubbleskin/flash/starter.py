"""The `main.py` that goes onto a stock MicroPython: it starts one of two slots."""

SLOTS = ("a", "b")
FOLDER = "/bubbleskin-"
"""What a slot's folder is called, without its letter."""
POINTER = "/bubbleskin-slot"
"""The file that says which slot is in use: one letter."""
TRIAL = "/bubbleskin-trial"
"""The file that says which slot is to be tried at the next start, and only then."""
MAIN = "/main.py"
MARK = "# bubbleskin starter"
"""How our `main.py` begins. Another one is the user's own."""

TEXT = f'''\
{MARK}: runs the firmware in {FOLDER}a or {FOLDER}b. Written by `bubbleskin flash`; do not change it.
import os
import sys

import micropython

micropython.kbd_intr(-1)  # a frame of the host may hold a Ctrl-C


def letter(name):
    try:
        with open(name) as file:
            return file.read(1)
    except OSError:
        return ""


trial = letter("{TRIAL}")
if trial:  # once: whatever happens now, the next start is not a trial
    os.remove("{TRIAL}")
now = letter("{POINTER}")
slots = [trial, now]
if now:  # one has answered, so it can only have been damaged: the other one is better than nothing
    slots += [other for other in "ab" if other not in slots]
slot = ""
problem = ""
for slot in slots:
    path = "{FOLDER}" + slot
    try:
        os.stat(path + "/start.mpy")
    except OSError:
        continue
    sys.path.insert(0, path)
    try:
        import start

        problem = problem or "it came to an end"
    except SystemExit:  # the prompt has been asked for
        break
    except BaseException as error:
        sys.print_exception(error)
        problem = problem or repr(error)
    sys.path.remove(path)
    for name in list(sys.modules):
        if name == "start" or name.startswith("bubble_"):
            del sys.modules[name]
else:
    slot = ""
micropython.kbd_intr(3)
'''
