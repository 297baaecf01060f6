"""The firmware's data as a stock MicroPython gets it: smaller, and the same schema."""

import subprocess
import sys

import pytest

from bubble_protocol import codec
from bubbleskin.flash.lean import lean
from bubbleskin.toolchain.frozen import device_files

DATA = b'''"""A text."""
from bubble_protocol.kinds import U8, U16
ONE, TWO, THREE = range(1, 4)
NAMES = ((ONE, "one", "the first of them"), (THREE, "three", "as one"))
WIDE = 7
FIELDS = (("height_um", U8, "how high it is"),)
'''
CODE = b"from bubble_protocol.data import FIELDS\nimport bubble_protocol.data as data\nprint('a text', data.TWO)\n"


def test_texts_and_what_nobody_asks_for_are_left_out():
    sources = {
        "bubble_protocol/data.py": DATA,
        "bubble_protocol/kinds.py": b"U8, U16 = 1, 2\n",
        "bubble_firmware/app.py": CODE,
        "bubble_firmware/nominal.py": b"UNUSED = 'a text'\nTHREE = 3\n",
        "bubble_firmware/mixed.py": b"SAID = 'a text'\nprint(SAID)\n",
    }
    assert lean(sources) == {
        "bubble_protocol/data.py": b"from bubble_protocol.kinds import U8\nTWO = 2\nFIELDS = (('height_um', U8, ''),)",
        "bubble_protocol/kinds.py": b"U8 = 1",
        "bubble_firmware/app.py": CODE,
        "bubble_firmware/nominal.py": b"",
        "bubble_firmware/mixed.py": b"SAID = 'a text'\nprint(SAID)\n",
    }


@pytest.mark.medium
def test_the_schema_stays_the_same_to_the_byte(tmp_path):
    sources = device_files("wristband19")
    slim = lean(sources)
    assert sum(map(len, slim.values())) < sum(map(len, sources.values())) - 15000
    for name, data in slim.items():
        compile(data, name, "exec")
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(data)
    script = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "from bubble_protocol import codec, packing\n"
        f"assert codec.__file__.startswith({str(tmp_path)!r})\n"
        "import bubble_firmware.app, bubble_firmware.boards.wristband19\n"
        "from bubble_protocol.schema.packed import PACKED\n"
        "assert len(PACKED) == len(packing.BY_ID) == len(codec.BY_ID)\n"
        "sys.stdout.buffer.write(codec.schema_bytes())\n"
    )
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, check=False)
    assert not said.stderr, said.stderr.decode()
    assert said.stdout == codec.schema_bytes()
