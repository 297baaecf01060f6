"""The editor as pages share it, without any: files in and out, and a wristband that becomes another."""

import asyncio

import pytest

import bubbleskin as bs
from bubbleskin.sequence.library import LIBRARY
from bubbleskin.studio.editor import FIRST, Editor
from bubbleskin.studio.owner import Owner


@pytest.fixture
def met(in_a_loop):
    """`met(act, url)`: what `act(editor, owner)`, a coroutine, says of an editor that knows the wristband at `url`."""

    def run(act, url="sim://wristband7"):
        async def whole():
            owner = Owner()
            editor = Editor(owner)
            await owner.open(url)
            try:
                editor.meet()
                return await act(editor, owner)
            finally:
                await owner.close()

        return in_a_loop(whole())

    return run


async def _foreseen(editor):
    while editor.forecast is None or editor.forecast.sequence is not editor.timeline.sequence:
        await asyncio.sleep(0.01)
    return editor.forecast


@pytest.mark.parametrize(
    ("name", "data", "why"),
    [
        ("a.exe", b"", "no sequence"),
        ("a", b"", "without an ending"),
        ("../../etc/passwd.json", b"/etc/passwd", "passwd.json is not JSON"),
        ("a.json", b"\xff\xfe", "a.json"),
        ("a.csv", b"", "a.csv"),
    ],
)
def test_what_is_no_sequence_is_refused_and_changes_nothing(met, name, data, why):
    async def act(editor, owner):
        before = editor.timeline.sequence
        said = await editor.upload(name, data)
        assert editor.timeline.sequence is before
        return said

    said = met(act)
    assert why in said
    assert "/tmp" not in said


def test_a_saved_file_has_a_name_that_is_no_path(met):
    async def act(editor, owner):
        for name in ("../../a b", "", "päth/é", "x" * 99):
            await editor.upload("a.json", bs.Sequence([bs.Step([6.0] * 7, 0.5)], name=name).to_json().encode())
            title, text = editor.saved()
            names.append(title)
            assert bs.Sequence.from_json(text) == editor.timeline.sequence
            assert editor.timeline.sequence.name == name

    names = []
    met(act)
    assert names == ["a-b.json", "sequence.json", "p-th.json", f"{'x' * 40}.json"]


def test_another_wristband_keeps_what_was_edited_and_only_that(met):
    async def act(editor, owner):
        assert editor.timeline.sequence == LIBRARY[FIRST](owner.skin.layout)
        await owner.open("sim://wristband19")
        editor.meet()
        assert editor.timeline.sequence == LIBRARY[FIRST](owner.skin.layout)  # nobody had touched it
        editor.open("wave")
        kept = editor.timeline.sequence
        await owner.open("sim://wristband7")
        editor.meet()
        assert editor.timeline.sequence is kept
        assert (await _foreseen(editor)).refused == "The sequence is for 19 bubbles; this wristband7 has 7."

    met(act)


def test_nothing_is_edited_before_there_is_a_wristband():
    editor = Editor(Owner())
    with pytest.raises(bs.InvalidInput, match="No wristband"):
        editor.saved()


def test_the_newest_is_foreseen_however_quick_changes_come(met):
    async def act(editor, owner):
        for height in (6.0, 7.0, 8.0, 9.0):
            change = {"kind": "place", "step": 0, "row": 0, "height": height, "revision": editor.timeline.revision}
            editor.change(change)
            assert editor.problem == ""
            await asyncio.sleep(0)
        editor.look_at(10_000)
        forecast = await _foreseen(editor)
        assert forecast.sequence.each[0].targets_mm[0] == 9.0
        while editor.tops_mm is None:
            await asyncio.sleep(0.01)
        editor.change({"kind": "place", "step": 0, "row": 0, "height": 6.0, "revision": 0})
        assert "changed elsewhere" in editor.problem
        assert editor.timeline.sequence is forecast.sequence
        editor.change({"kind": "rows", "rows": "all", "revision": 0})  # which changes nothing of it
        assert (editor.problem, editor.timeline.rows_are) == ("", "all")

    met(act)
