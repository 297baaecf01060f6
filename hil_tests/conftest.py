"""One suite, every target: simulated, MicroPython in a subprocess, a real board. Through the public SDK only."""

import base64
import contextlib
import io
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

import bubbleskin as bs

TARGETS = ("sim://wristband7?contact=0", "micropython://wristband7?contact=0")
"""Taken where no target is named, the second one as slow. Bubbles stand alone: where they touch, heights are those of each by
itself, because the firmware cannot see that a neighbour lifts a bubble."""
EMULATED_SLOWNESS = 10
"""Times as long as on a real board, at most: guards against hangs are longer by this on an emulated chip."""
FLAT_KPA = 0.4  # sensor noise is 50 Pa
ORDER = (
    "test_first_moves",
    "test_line",
    "test_link",
    "test_limits",
    "test_vent_stop",
    "test_steps",
    "test_sequences",
    "test_store",
)
"""What a board goes through: one bubble before all, low before high, ways to stop before ways to move; the rest comes last."""
MARKS = {
    "slow": "takes seconds",
    "medium": "takes half a second and more",
    "long": "takes long in the chip's own time: left out on an emulated chip",
    "promise": "promise(id, …): shows these promises of hil_tests/promises.toml; the first has the test's figures",
    "fails_on_purpose": "makes a part fail: on a real board only with --permit-failures",
    "not_on": "not_on(target, reason): cannot be tried on sim, micropython, rp2040 or a board",
}
KINDS = ("sim", "micropython", "rp2040", "board")
"""Of targets: what runs the firmware. `board` is a real one, whatever its port."""
NOT_PERMITTED = "a real board is made to fail only where --permit-failures says so"
LONG = "an emulated second takes twenty"

_SKIN = pytest.StashKey[bs.Skin]()
_TRACE = pytest.StashKey["Trace"]()


def pytest_configure(config):
    """From a wheel there is no pyproject.toml that tells them."""
    for mark, meaning in MARKS.items():
        config.addinivalue_line("markers", f"{mark}: {meaning}")


def pytest_addoption(parser):
    parser.addoption(
        "--target",
        action="append",
        metavar="URL",
        help=f"run hil_tests on this device; repeat for several (default: {' and '.join(TARGETS)})",
    )
    parser.addoption(
        "--permit-failures",
        action="store_true",
        help="let a real wristband make parts of itself fail, such as a sensor that is gone: nobody may wear it",
    )


def pytest_generate_tests(metafunc):
    if "target" in metafunc.fixturenames:
        everyday, *others = TARGETS
        usual = [everyday, *[pytest.param(url, marks=pytest.mark.slow) for url in others]]
        metafunc.parametrize("target", metafunc.config.getoption("--target") or usual, scope="session")


def pytest_collection_modifyitems(config, items):
    """In an order that is kind to a board, without what cannot be tried there; a real board's report says why.

    An emulated chip takes 20 times longer than a real one: there, hangs are found later, too.
    """
    ours = [item for item in items if "target" in getattr(item, "fixturenames", ())]
    places = [place for place, item in enumerate(items) if "target" in getattr(item, "fixturenames", ())]
    for place, item in zip(places, sorted(ours, key=_turn), strict=True):
        items[place] = item
    left_out = []
    for item in ours:
        kind = kind_of(_target(item))
        item.user_properties.append(("target", kind))
        reason = why_not(item, kind)
        if reason and kind == "board":
            item.add_marker(pytest.mark.skip(reason=reason))
        elif reason:
            left_out.append(item)
        if kind == "rp2040" and (guard := item.get_closest_marker("timeout")):
            item.add_marker(pytest.mark.timeout(EMULATED_SLOWNESS * guard.args[0]), append=False)
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in left_out]


def kind_of(target: str) -> str:
    """Which of `KINDS` a device is."""
    scheme, colon, _ = target.partition("://")
    return scheme if colon and scheme in KINDS else "board"


def why_not(item, kind: str) -> str:
    """Why a test is not tried on such a target; nothing where it is."""
    if kind == "rp2040" and item.get_closest_marker("long"):
        return LONG
    if (
        kind == "board"
        and item.get_closest_marker("fails_on_purpose")
        and not item.config.getoption("--permit-failures")
    ):
        return NOT_PERMITTED
    return next((reason for at, reason in (mark.args for mark in item.iter_markers("not_on")) if at == kind), "")


def _target(item) -> str:
    return item.callspec.params.get("target", "") if hasattr(item, "callspec") else ""


def _turn(item) -> tuple[str, int]:
    name = item.path.stem
    return _target(item), ORDER.index(name) if name in ORDER else len(ORDER)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item):
    """What the wristband says of a failure stands beside it; and a board that fails its first moves goes no further."""
    report = yield
    if report.when == "call" and report.failed:
        if skin := item.stash.get(_SKIN, None):
            report.sections.append(("What the wristband says", _said(skin)))
            if item.config.pluginmanager.hasplugin("html"):
                report.extras = _pictures(skin, item.stash.get(_TRACE, None))
        if item.path.stem == ORDER[0] and "://" not in _target(item):
            item.session.shouldfail = "A first move has failed, so this board is not asked for more. Mend that first."
    return report


def _said(skin: bs.Skin) -> str:
    """State, faults, causes and remedies, as far as there is an answer."""
    lines = []
    for ask in (skin.health, skin.state, skin.fault_log):
        try:
            said = ask()
        except bs.BubbleskinError as error:
            said = str(error)
        lines += [str(each) for each in said] if isinstance(said, list) else [str(said)]
    return "\n".join(lines)


def _pictures(skin: bs.Skin, trace: "Trace | None") -> list[object]:
    """For the report that `--html` writes: what stands there, and what was watched last."""
    from pytest_html import extras

    pictures = []
    with contextlib.suppress(bs.BubbleskinError):
        pictures.append(skin._repr_png_())
    if trace is not None:
        pictures.append(_drawn(trace))
    return [extras.png(base64.b64encode(picture).decode()) for picture in pictures if picture]


def _drawn(trace: "Trace") -> bytes:
    """Heights over time, a line for each bubble, as a PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 3.0), layout="constrained")
    axes = figure.add_subplot(xlabel="s since the watch began", ylabel="height, mm")
    for bubble, height in enumerate(trace.height_mm.T):
        axes.plot(trace.time, height, label=str(bubble))
    axes.legend(title="bubble", fontsize="small", ncols=2, loc="center left", bbox_to_anchor=(1.0, 0.5))
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=120)
    return drawn.getvalue()


def connect(target: str) -> bs.Skin:
    try:
        return bs.connect(target)
    except bs.BubbleskinError as error:
        # Only a missing interpreter, UF2 or emulator is a plain BubbleskinError; a silent firmware is a LinkError.
        missing = target.startswith(("micropython:", "rp2040:")) and type(error) is bs.BubbleskinError
        if missing and not os.environ.get("CI"):
            pytest.skip(str(error))
        raise


@pytest.fixture
def skin(target: str, request: pytest.FixtureRequest) -> Iterator[bs.Skin]:
    """A fresh connection to a flat wristband, which is vented in the end."""
    with connect(target) as skin:
        request.node.stash[_SKIN] = skin
        skin.vent()
        for _ in range(40):
            if np.abs(skin.state().pressure_kpa).max() < FLAT_KPA:
                break
            skin.sleep(0.1)
        yield skin
        with contextlib.suppress(bs.LinkError):  # a test that lost the link has said so
            skin.vent()


@dataclass(frozen=True)
class Trace:
    """What was seen: one row per moment. On a simulated board all pulses, and the true heights of each bubble by itself; on
    a real one what the firmware believes of it."""

    time: NDArray[np.float64]
    """s since the watch began, (k,)."""
    height_mm: NDArray[np.float64]
    """(k, n)."""
    pulses: NDArray[np.bool_] | None
    """Whether a valve pulse of the bubble began in the tick that followed, (k, n); None on a real board."""

    def since(self, seconds: float) -> "Trace":
        """The part from `seconds` on."""
        late = self.time >= seconds - 1e-9
        return Trace(self.time[late], self.height_mm[late], None if self.pulses is None else self.pulses[late])

    def busiest_second(self) -> NDArray[np.int64]:
        """Most pulses of each bubble within any one second, (n,)."""
        assert self.pulses is not None
        count = np.cumsum(np.vstack([np.zeros_like(self.pulses[:1]), self.pulses]), axis=0, dtype=int)
        second = round(1 / (self.time[1] - self.time[0]))
        return (count[second:] - count[:-second]).max(axis=0)


@pytest.fixture
def board(skin: bs.Skin):
    """The simulated board behind `skin`, which knows the truth; a test that asks for it is skipped on a real one."""
    if not skin.simulated:
        pytest.skip("a real board does not know the truth")
    return skin.simulated


@pytest.fixture
def failing(skin: bs.Skin) -> Iterator[Callable[[str, int, str], None]]:
    """`failing(part, bubble, how)`: make a part fail, or mend it; mended in the end. With the mark `fails_on_purpose`."""
    if not skin.simulated:
        skin.permit_injection()
    failed = set()

    def fail(part: str, bubble: int, how: str) -> None:
        skin.inject(part, bubble, how)
        failed.add((part, bubble))

    yield fail
    for part, bubble in failed:
        skin.inject(part, bubble, "healthy")
    skin.vent()
    skin.sleep(1.0)
    skin.clear_faults()


@pytest.fixture
def watch(skin: bs.Skin, request: pytest.FixtureRequest) -> Callable[[float], Trace]:
    """`watch(seconds)`: look at the bubbles for so long, from now on."""

    def true_heights(board, seconds: float) -> Trace:
        tick, n = skin.info.tick, skin.info.bubbles
        ticks = round(seconds / tick) + 1
        heights, on = np.empty((ticks, n)), np.empty((ticks, n, 2))
        for k in range(ticks):
            heights[k], on[k] = board.alone_mm, board.pulses
            skin.sleep(tick)
        still_on = np.zeros(on.shape, bool)  # a valve that stays on begins no pulse
        still_on[1:] = on[:-1] >= tick
        return Trace(np.arange(ticks) * tick, heights, ((on > 0) & ~still_on).any(axis=2))

    def estimates(seconds: float) -> Trace:
        begin = skin.state().time
        times, heights = [], []
        with contextlib.closing(skin.telemetry(min(50, 1 / skin.info.tick))) as states:
            for state in states:
                times.append(state.time - begin)
                heights.append(state.alone_mm)
                if times[-1] >= seconds:
                    return Trace(np.array(times), np.array(heights), None)
        raise AssertionError("telemetry has ended")

    def watched(seconds: float) -> Trace:
        trace = true_heights(skin.simulated, seconds) if skin.simulated else estimates(seconds)
        request.node.stash[_TRACE] = trace
        return trace

    return watched


@pytest.fixture
def pressed(skin: bs.Skin) -> Callable[[NDArray[np.float64]], NDArray[np.bool_]]:
    """`pressed(height_mm)`: which bubbles of a simulated board touch a neighbour there, (n,); none of a real one."""

    def touching(height_mm: NDArray[np.float64]) -> NDArray[np.bool_]:
        place, radius = skin.layout.positions_mm, np.asarray(height_mm) / 2
        pairs = np.linalg.norm(place[:, None] - place, axis=2) < radius[:, None] + radius
        np.fill_diagonal(pairs, False)
        has_contact = bool(skin.simulated and len(skin.simulated.plant.position_m))
        return pairs.any(axis=1) & has_contact

    return touching


@pytest.fixture
def record_property(record_property):
    """pytest's own, for numbers of numpy too: reports go from process to process in words that know none."""
    return lambda name, value: record_property(name, float(value))
