"""Processes that work for a sweep, and end with it however it ends."""

import os
import threading
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import connection, parent_process


def processes(count: int | None = None) -> ProcessPoolExecutor:
    """So many processes, None for one on each core."""
    return ProcessPoolExecutor(count, initializer=end_with_parent)


def end_with_parent() -> None:
    """From now on this process ends when the one that started it does, killed or not: it would wait for work for ever."""
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_end_after, args=(parent.sentinel,), daemon=True).start()


def _end_after(sentinel: int) -> None:
    connection.wait([sentinel])
    os._exit(1)
