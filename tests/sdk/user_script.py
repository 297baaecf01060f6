"""What a user writes: `test_types.py` has it checked, and looks at the type of everything in `seen`. Nobody runs it."""

import asyncio

import numpy as np

import bubbleskin as bs

with bs.connect("sim://wristband7?seed=3", timeout=1.0) as skin:
    reveal_type(skin)  # is: Skin
    reveal_type(skin.info.height_max_mm)  # is: float
    reveal_type(skin.layout.positions_mm)  # is: ndarray
    reveal_type(skin.show(np.full(7, 9.0)))  # is: State
    reveal_type(skin.show([9.0] * 7, over=0.5, wait=True))  # is: State
    reveal_type(skin.show([9.0] * 7, wait=False))  # is: None
    reveal_type(skin.show([9.0] * 7, 0.5, False))  # is: None
    patient = skin.info.bubbles > 7
    reveal_type(skin.show([9.0] * 7, wait=patient))  # is: State | None
    skin.show(lambda x, y: 8 + 0.1 * x)

    def slope(x_mm: float, y_mm: float) -> float:
        return 8 + 0.1 * x_mm

    skin.show(slope)
    skin.show(bs.shapes.dome(skin.layout))
    reveal_type(skin.state().height_mm)  # is: ndarray
    reveal_type(skin.state().faults)  # is: tuple
    reveal_type(skin.health().board_faults)  # is: tuple
    reveal_type(skin.faults())  # is: dict
    reveal_type(skin.fault_log()[0].remedy)  # is: str
    reveal_type(skin.settings()["deadman_vent"].value)  # is: float
    skin.configure(deadman_vent=5.0)
    reveal_type(skin.trim().zero)  # is: ndarray
    reveal_type(skin.stored())  # is: StoreInfo
    reveal_type(skin.clock.now())  # is: float
    for state in skin.telemetry(50, ["height", "pressure"]):
        reveal_type(state)  # is: State
        break
    with skin.record("show.csv", rate_hz=50) as recording:
        reveal_type(recording.rows)  # is: int
    board = skin.simulated
    reveal_type(board)  # is: Simulated | None
    if board is not None:
        reveal_type(board.height_mm)  # is: ndarray
        board.inject("pop_off", 3, 1.0)

    sequence = bs.Sequence([bs.Step([9.0] * 7, ramp=1.0, until=bs.Settled()), bs.Repeat([bs.Step([6.0] * 7, 0.5)], 2)])
    reveal_type(sequence.duration)  # is: float
    reveal_type(sequence.targets_at(0.5))  # is: ndarray
    reveal_type(bs.sequences.pulse(skin.layout, loops=2))  # is: Sequence
    report = skin.play(sequence, progress=lambda status: print(status.step))
    reveal_type(report)  # is: PlaybackReport
    reveal_type(skin.play("wave.json", wait=False))  # is: None
    reveal_type(skin.playing().state)  # is: str

    balloon = bs.YeohBalloon()
    reveal_type(balloon.pressure(1.5))  # is: float
    reveal_type(balloon.pressure(np.linspace(1, 3, 9)))  # is: ndarray
    reveal_type(balloon.heights(2e4))  # is: ndarray
    reveal_type(balloon.limit_points()[0].pressure)  # is: float
    table = bs.build_table(balloon)
    reveal_type(table)  # is: Table
    reveal_type(table.pressure_at(9000))  # is: int
    skin.upload_tables(table)
    reveal_type(skin.read_tables())  # is: list

    plan = bs.plan(np.full(7, 10.0), skin.layout)
    reveal_type(plan)  # is: Plan
    reveal_type(plan.predicted_mm)  # is: ndarray
    reveal_type(plan.sequence)  # is: Sequence
    skin.play(plan)
    reveal_type(bs.CompliantContact(skin.layout).settle([np.full(7, 2e4)]).height_mm)  # is: ndarray


async def both(one: str, other: str) -> None:
    """Two wristbands at a time."""
    async with await bs.aconnect(one) as left, await bs.aconnect(other) as right:
        reveal_type(left)  # is: AsyncSkin
        states = await asyncio.gather(left.show([9.0] * 7), right.show([9.0] * 7))
        reveal_type(states[0])  # is: State
        reveal_type(await left.show([9.0] * 7, wait=False))  # is: None
        reveal_type(await right.play("wave.json"))  # is: PlaybackReport


skin.shwo([9.0] * 7)  # wrong: no such method
bs.conect("sim://wristband7")  # wrong: no such function
skin.show([9.0] * 7, ovr=0.5)  # wrong: no such argument
skin.show([9.0] * 7, over="slowly")  # wrong: not a number
skin.show([9.0] * 7, wait=False).height_mm  # wrong: nothing is returned
skin.play(42)  # wrong: not a sequence
skin.restart(into=3)  # wrong: not a name
