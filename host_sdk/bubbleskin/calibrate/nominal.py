"""What a bubble is taken for before anything is known of it: the figures of its board's file, in mm, ms, Pa and µJ."""

from types import ModuleType
from typing import NamedTuple

import numpy as np

_ISO_PA = 1e5
"""Pressure for which ISO 6358 states conductances."""


class Nominal(NamedTuple):
    """Of one board; every bubble of it is alike."""

    gain: float
    """Flow of a restrictor in µJ/ms: of √((p₁ − p₂)(p₂ + (1 − 2b) p₁)), Pa."""
    critical_ratio: float
    opens_ms: float
    closes_ms: float
    line_mm3: float
    rest_mm: float
    height_max_mm: float
    pressure_max_pa: float
    air_max_uj: float
    zero_counts: float
    pa_per_count: float

    @classmethod
    def of(cls, board: ModuleType) -> "Nominal":
        """From a board's file."""
        critical = board.CRITICAL_RATIO / 256
        conductance = board.CONDUCTANCE * 1e-14  # 1e-6 dm³/(s bar) to m³/(s Pa)
        return cls(
            gain=1e3 * conductance * _ISO_PA / (1.0 - critical),
            critical_ratio=critical,
            opens_ms=board.VALVE_OPENS_US * 1e-3,
            closes_ms=board.VALVE_CLOSES_US * 1e-3,
            line_mm3=float(board.DEAD_VOLUME_MM3),
            rest_mm=board.HEIGHT_REST_UM * 1e-3,
            height_max_mm=board.HEIGHT_MAX_UM * 1e-3,
            pressure_max_pa=float(board.PRESSURE_MAX_PA),
            air_max_uj=float(board.AIR_MAX_UJ),
            zero_counts=float(board.SENSOR_ZERO),
            pa_per_count=float(board.SENSOR_PA_PER_COUNT),
        )


def sphere_mm3(height_mm: np.ndarray | float) -> np.ndarray:
    """Volume of a sphere of that diameter."""
    return np.asarray(np.pi / 6.0 * np.asarray(height_mm, float) ** 3)


def height_mm(volume_mm3: np.ndarray) -> np.ndarray:
    """Diameter of a sphere of that volume."""
    return np.asarray(np.cbrt(6.0 / np.pi * volume_mm3))
