# Gives the firmware's store flash of its own: 32 kB between MicroPython and its file system, which neither touches.
#
# MicroPython has a name for such a place, ROMFS, and hands it out as a block device (`vfs.rom_ioctl`). Nothing of a
# ROM file system is in it. Both definitions are needed: of the code, and of the pass that collects names from it.
set(MICROPY_CPP_DEF_EXTRA MICROPY_HW_ROMFS_BYTES=32768)
target_compile_definitions(usermod INTERFACE MICROPY_HW_ROMFS_BYTES=32768)
