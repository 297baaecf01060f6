"""What the packages are that firmware and interpreter are built of: SHA-256 of every file that is fetched."""

import hashlib
from pathlib import Path

from bubbleskin.errors import BubbleskinError

SHA256 = {
    "micropython_1.25.0+ds-1.dsc": "8c7c406be88a6f3bc19e694eb0bbc5841112243fdf2b5a296e000d8fdc5f3c34",
    "micropython_1.25.0+ds.orig.tar.xz": "7b25be99a502f070b2de81dafc08da7051d992325d6e67daa9045a918fffdbea",
    "micropython_1.25.0+ds-1.debian.tar.xz": "87cd89f7900c86b963885dabe25acf3e5348815993f1500278ad8f6464465af4",
    "pico-sdk-source_2.1.1-1_all.deb": "507a3ca37636641bc90239d7c04dc9dc28c5008087a8162102ea94d2273153d3",
    "tinyusb-source_0.18.0+dfsg-1_all.deb": "01ce2c645df68f14a8a7dcfc8fb355713152543757955820479a87949a61154e",
}
"""By the names under which Debian's archive has them."""


def verify(path: Path, known: dict[str, str] = SHA256) -> None:
    """`BubbleskinError` where the file is none of `known`, by name and content."""
    wanted = known.get(path.name)
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    if found == wanted:
        return
    what = f"its SHA-256 should be {wanted} and is {found}" if wanted else f"nobody has looked at it: SHA-256 {found}"
    raise BubbleskinError(
        f"{path.name} is not what we build of: {what}. It is not used. Where Debian has brought out a new revision, "
        f"look at what has changed, then put its name and SHA-256 into {Path(__file__).name}."
    )
