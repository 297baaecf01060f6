"""A board for the power cuts: MicroPython's file system in memory, its `main.py`, then a prompt of lines. Runs in MicroPython.

Its image is read from and written to a file of the host; every erase and every write of flash goes to a journal.
"""

import binascii
import struct
import sys

import vfs

BLOCK, BLOCKS = 4096, 96


class Flash:
    """A block device as `rp2.Flash` is one."""

    def __init__(self, image, journal):
        with open(image, "rb") as file:
            self.data = bytearray(file.read())
        self.journal = open(journal, "ab")

    def readblocks(self, number, buffer, offset=0):
        at = number * BLOCK + offset
        buffer[:] = self.data[at : at + len(buffer)]

    def writeblocks(self, number, buffer, offset=0):
        self.change(number * BLOCK + offset, buffer)

    def change(self, at, data):
        self.data[at : at + len(data)] = data
        self.journal.write(struct.pack("<II", at, len(data)))
        self.journal.write(data)
        self.journal.flush()

    def ioctl(self, operation, argument):
        if operation == 4:
            return BLOCKS
        if operation == 5:
            return BLOCK
        if operation == 6:
            self.change(argument * BLOCK, b"\xff" * BLOCK)
        return 0


def run(script, names):
    """As the raw prompt does: what is printed, an end, the complaint, an end."""
    complaint = ""
    try:
        exec(script, names)
    except Exception as error:
        complaint = type(error).__name__ + ": " + str(error)
    print("\x04" + complaint + "\x04")


flash = Flash(sys.argv[1], sys.argv[2])
try:
    files = vfs.VfsLfs2(flash, progsize=256)
except OSError:  # a new board
    vfs.VfsLfs2.mkfs(flash, progsize=256)
    files = vfs.VfsLfs2(flash, progsize=256)
vfs.umount("/")
vfs.mount(files, "/")
sys.path[:] = ["", ".frozen", "/lib"]
names = {"__name__": "__main__"}
try:
    with open("/main.py") as file:
        main = file.read()
except OSError:
    main = ""
run(main, names)
while True:
    line = sys.stdin.readline()
    if not line:
        break
    run(binascii.a2b_base64(line).decode(), names)
