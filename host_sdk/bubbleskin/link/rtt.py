"""How long to wait for an answer before sending again. No I/O, no clock."""


class RttEstimator:
    """The retransmission timeout of RFC 6298, with Karn's rule. All times in s.

    Only answers to what was sent once, or that tell which sending they answer as those to PING and HELLO do, are
    measured; so waiting longer for one request says nothing of the next.
    """

    FIRST = 0.25
    """Timeout before anything has been measured."""
    FLOOR = 0.03
    """Shortest timeout."""
    MOST = 0.25
    """Longest that backing off leads to, unless the timeout itself is longer."""

    def __init__(self) -> None:
        self.smoothed: float | None = None
        """Smoothed round trip; None before the first."""
        self.variation = 0.0

    @property
    def timeout(self) -> float:
        """For a request that is sent now."""
        if self.smoothed is None:
            return self.FIRST
        return max(self.FLOOR, self.smoothed + 4 * self.variation)

    def backoff(self, patience: float) -> float:
        """How long to wait the next time, when nothing has come within `patience`."""
        return min(2 * patience, max(self.MOST, self.timeout))

    def update(self, seconds: float) -> None:
        """Take one round trip."""
        if self.smoothed is None:
            self.smoothed, self.variation = seconds, seconds / 2
        else:
            self.variation += (abs(self.smoothed - seconds) - self.variation) / 4
            self.smoothed += (seconds - self.smoothed) / 8
