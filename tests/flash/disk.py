"""Makes the file system of a board, as a stock MicroPython has it in flash. Runs in MicroPython.

Arguments: a file of lines "path on the board TAB file of the host", the image to write, its size in blocks.
"""

import sys

import vfs

BLOCK = 4096


class Flash:
    """A block device as `rp2.Flash` is one."""

    def __init__(self, blocks):
        self.data = bytearray(b"\xff" * (BLOCK * blocks))

    def readblocks(self, number, buffer, offset=0):
        at = number * BLOCK + offset
        buffer[:] = self.data[at : at + len(buffer)]

    def writeblocks(self, number, buffer, offset=0):
        at = number * BLOCK + offset
        self.data[at : at + len(buffer)] = buffer

    def ioctl(self, operation, argument):
        if operation == 4:
            return len(self.data) // BLOCK
        if operation == 5:
            return BLOCK
        if operation == 6:
            self.writeblocks(argument, b"\xff" * BLOCK)
        return 0


flash = Flash(int(sys.argv[3]))
vfs.VfsLfs2.mkfs(flash, progsize=256)
files = vfs.VfsLfs2(flash, progsize=256)
folders = set()
with open(sys.argv[1]) as names:
    for line in names:
        path, source = line.strip().split("\t")
        above = ""
        for folder in path.split("/")[1:-1]:
            above += "/" + folder
            if above not in folders:
                folders.add(above)
                files.mkdir(above)
        with open(source, "rb") as content, files.open(path, "wb") as file:
            file.write(content.read())
with open(sys.argv[2], "wb") as image:
    image.write(flash.data)
