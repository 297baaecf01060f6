"""The chip's firmware: what decides its bytes, and that nothing else does."""

import os
import shutil

import pytest

from bubbleskin import boards
from bubbleskin.errors import BubbleskinError
from bubbleskin.toolchain import frozen, rp2040

FILES = {"firmware/manifest.py": b"1", "firmware/bubble_firmware/main.py": b"2"}


def test_the_key_follows_board_and_compiler_and_every_byte_that_is_frozen():
    keys = {
        frozen.key("12.2.1", FILES),
        frozen.key("13.2.1", FILES),
        frozen.key("12.2.1", {**FILES, "firmware/manifest.py": b"3"}),
        frozen.key("12.2.1", {**FILES, "x.py": b""}),
        *(frozen.key("12.2.1", frozen.staged_files(board)) for board in (*boards.NAMES, frozen.BARE, frozen.STOCK)),
    }
    assert len(keys) == 6 + len(boards.NAMES)
    assert frozen.key("12.2.1", dict(reversed(FILES.items()))) in keys


def test_both_packages_and_the_manifest_are_frozen():
    files = frozen.staged_files("wristband7")
    assert {"manifest.py", "firmware/manifest.py", "firmware/bubble_firmware/main.py"} <= set(files)
    assert "protocol/bubble_protocol/codec.py" in files
    assert not any("__pycache__" in name or name.startswith("/") for name in files)


def test_staging_touches_only_what_has_changed(tmp_path):
    frozen.stage(tmp_path, {**FILES, "firmware/bubble_firmware/old.py": b"4"})
    main = tmp_path / "firmware/bubble_firmware/main.py"
    os.utime(main, (1, 1))
    manifest = frozen.stage(tmp_path, {**FILES, "start/main.py": b"5"})
    assert manifest == tmp_path / "manifest.py"
    assert main.stat().st_mtime == 1
    assert not main.with_name("old.py").exists()
    assert (tmp_path / "start/main.py").read_bytes() == b"5"


def test_a_checkout_is_looked_at_before_anything_is_built(tmp_path):
    with pytest.raises(BubbleskinError, match="not a MicroPython checkout"):
        rp2040.firmware(["wristband7"], tmp_path)
    for name in ("ports/rp2/CMakeLists.txt", "tools/mpy-tool.py"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text("__attribute__ ((aligned (2)))")
    with pytest.raises(BubbleskinError, match=r"aligned \(4\)"):
        rp2040.firmware(["wristband7"], tmp_path)


@pytest.mark.chip
def test_the_same_inputs_give_the_same_bytes_in_another_folder(tmp_path):
    try:
        first = rp2040.firmware(["wristband7"])["wristband7"]
    except BubbleskinError as problem:
        if os.environ.get("CI"):
            raise
        pytest.skip(str(problem))
    for name in ("source", "pico-sdk"):  # fetched once; everything else is made anew
        shutil.copytree(rp2040.folder() / name, tmp_path / name, symlinks=True)
    second = rp2040.firmware(["wristband7"], home=tmp_path)["wristband7"]
    assert second.name == first.name  # the hash of the inputs
    assert second.read_bytes() == first.read_bytes()
