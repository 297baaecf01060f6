"""Where the command begins, and what Ctrl-C means from then on: importing the rest takes most of a second."""

import os
from types import FrameType

_AGAIN = 0.05  # seconds after which it is looked again whether that is over

_LLVM = f"{os.sep}llvmlite{os.sep}"
_WEAK = f"{os.sep}matplotlib{os.sep}transforms.py"
"""Its weak references call back as objects are freed, wherever that is."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command, and end the process; see `bubbleskin.cli.command.main`."""
    try:
        with _CtrlC() as ctrl_c:
            from bubbleskin.cli.command import main as run

            ctrl_c.at_once = False
            run(arguments)
    except KeyboardInterrupt:
        _stop()


class _CtrlC:
    """While this is open Ctrl-C is a KeyboardInterrupt, but none within an import or where LLVM calls us.

    There C code prints it, makes another error of it, or loses it. While the command itself is imported, Ctrl-C ends the
    process `at_once`: nothing has been opened or written. Where it is ignored, or somebody else's, it stays so.
    """

    at_once = True

    def __enter__(self) -> "_CtrlC":
        import atexit
        import signal  # both in here, where the caller waits for a KeyboardInterrupt

        self._ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if self._ours:
            signal.signal(signal.SIGINT, self._pressed)
            atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)  # all is done: the status is what it is
        return self

    def __exit__(self, *raised: object) -> None:
        import signal

        if self._ours:
            if hasattr(signal, "setitimer"):
                signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def _pressed(self, number: int, frame: FrameType | None) -> None:
        import signal

        if self.at_once:
            _stop()
        if not (_called_by_c(frame) and hasattr(signal, "setitimer")):
            raise KeyboardInterrupt
        signal.signal(signal.SIGALRM, self._pressed)
        signal.setitimer(signal.ITIMER_REAL, _AGAIN)


def _called_by_c(frame: FrameType | None) -> bool:
    """Whether what runs is part of an import, or a callback from LLVM or from a weak reference of matplotlib's."""
    if frame and frame.f_code.co_name == "<lambda>" and frame.f_code.co_filename.endswith(_WEAK):
        return True
    while frame:
        file = frame.f_code.co_filename
        if file == "<frozen importlib._bootstrap>" or _LLVM in file:
            return True
        frame = frame.f_back
    return False


def _stop() -> None:
    os.write(2, b"Stopped.\n")
    os._exit(130)
