"""One skin in several threads: calls take turns."""

import threading

import pytest

import bubbleskin as bs

THREADS, CALLS = 6, 60


@pytest.mark.promise("threads")
def test_threads_take_turns_with_one_simulated_skin():
    problems = []
    states = []
    with bs.connect("sim://wristband7?contact=0") as skin:

        def work(number):
            try:
                for turn in range(CALLS // 3):
                    skin.show([6.0 + number / 10 + turn / 100] * 7, wait=False)
                    states.append(skin.state())
                    skin.faults()
            except Exception as problem:
                problems.append(problem)

        threads = [threading.Thread(target=work, args=(number,)) for number in range(THREADS)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        asked = {round(6.0 + number / 10 + turn / 100, 3) for number in range(THREADS) for turn in range(CALLS // 3)}
    assert problems == []
    assert len(states) == THREADS * CALLS // 3
    for state in states:  # each is of one SHOW, and none of a mixture
        (target,) = {round(float(mm), 3) for mm in state.target_mm}
        assert target in asked
