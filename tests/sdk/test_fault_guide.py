"""Every fault that the schema knows has a cause and a remedy, and whoever meets it is told."""

import numpy as np
import pytest

import bubbleskin as bs
from bubble_protocol.schema import faults
from bubbleskin.fault_guide import BOARD_GUIDE, BUBBLE_GUIDE, EVENT_GUIDE, GUIDE, guide, remedies


@pytest.mark.parametrize(
    ("schema", "known"),
    [(faults.FAULTS, BUBBLE_GUIDE), (faults.BOARD_FAULTS, BOARD_GUIDE), (faults.EVENTS, EVENT_GUIDE)],
)
def test_every_fault_has_one_in_the_schemas_order(schema, known):
    assert [name for _, name, _ in schema] == list(known)


@pytest.mark.parametrize("name", GUIDE)
def test_cause_and_remedy_make_sentences(name):
    cause, remedy = guide(name)
    assert cause[0].islower()
    assert not cause.endswith(".")
    assert remedy[0].isupper()
    assert not remedy.endswith(".")


def test_a_fault_of_newer_firmware_has_a_remedy_too():
    assert "pip install --upgrade" in guide("of_tomorrow").remedy


def test_what_several_faults_have_in_common_is_said_once():
    assert remedies(["leak", "leak"]) == f"{guide('leak').remedy}."


def test_an_error_says_what_to_do():
    with bs.connect("sim://wristband7?contact=0") as skin:
        skin.show(np.full(7, 10.0))
        skin.simulated.inject("pop_off", 3, 1.0)
        skin.sleep(0.2)
        with pytest.raises(bs.DeviceFault, match=r"bubble 3: leak.*barb.*clear_faults"):
            skin.show(np.full(7, 10.0))
        (fault,) = skin.fault_log()
        assert (fault.cause, fault.remedy) == guide("leak")
        for words in ("leak of bubble 3", fault.meaning, fault.cause, fault.remedy):
            assert words in str(fault)
