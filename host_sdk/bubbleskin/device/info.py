"""Who a device is: the reply to HELLO."""

from dataclasses import dataclass
from typing import Self

from bubble_protocol.schema.system import CAN_ESTIMATE
from bubbleskin.link.message import SCHEMA_CRC, Message


@dataclass(frozen=True)
class Info:
    """Who a device is: constant from one boot to the next, but for `tables_crc`."""

    board: str
    bubbles: int
    firmware: str
    protocol: tuple[int, int]
    same_schema: bool
    """Whether device and SDK were made from the same message schema."""
    boot_id: int
    tick: float
    """Period of the control loop, s."""
    height_rest_mm: float
    height_max_mm: float
    pressure_max_kpa: float
    tables_crc: int
    tells_sd: bool = False
    """Whether it knows how well it knows a height, and the figures of each valve."""

    def __repr__(self) -> str:
        return (
            f"<Info {self.board}: {self.bubbles} bubbles up to {self.height_max_mm:g} mm, firmware {self.firmware}, "
            f"tick {self.tick * 1e3:g} ms>"
        )

    @classmethod
    def of(cls, hello: Message) -> Self:
        """From the reply to HELLO."""
        return cls(
            board=str(hello.fields["board"]),
            bubbles=hello["bubbles"],
            firmware=f"{hello['firmware_major']}.{hello['firmware_minor']}.{hello['firmware_patch']}",
            protocol=(hello["protocol_min"], hello["protocol_max"]),
            same_schema=hello["schema_crc"] == SCHEMA_CRC,
            boot_id=hello["boot_id"],
            tick=hello["tick_us"] * 1e-6,
            height_rest_mm=hello["height_rest_um"] / 1000,
            height_max_mm=hello["height_max_um"] / 1000,
            pressure_max_kpa=hello["pressure_max_pa"] / 1000,
            tables_crc=hello["tables_crc"],
            tells_sd=bool(hello["capabilities"] & CAN_ESTIMATE),
        )
