# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""Steps of a sequence on the wire and in the device's memory: records of 16-bit words, and what makes one sound.

| word | of a step | of a repeat |
|---|---|---|
| 0 | kind (bits 0, 1), easing (2, 3), until (4), then (5, 6) | kind alone |
| 1 | ramp, ms | times, 0: until it is stopped |
| 2 | ms after the ramp: the time to go on, or the timeout | – |
| 3 | tolerance, µm; 0 where it goes on by time | – |
| 4 + i | target of bubble i, µm; LEAVE: as it is | – |

A repeat stands before the records that it repeats and an end after them: there are no jumps, so what is properly
nested cannot go round for ever without time passing. All of it runs on host and device.
"""

from bubble_protocol.crc import TABLE
from bubble_protocol.mpy_compat import TYPE_CHECKING, const, micropython, ptr32

if TYPE_CHECKING:
    from bubble_protocol.mpy_compat import Words

# Whole numbers as `const`, each by itself: viper takes those of its own file.
STEP = const(0)  # kinds of records
REPEAT = const(1)
END = const(2)
LINEAR, SMOOTH, IN, OUT = range(4)  # easings
TIME, SETTLE = range(2)  # until
GO_ON, HOLD, VENT, STOP = range(4)  # then

HEAD = const(4)  # words before the targets
LEAVE = const(0xFFFF)
MS_MAX = const(60000)
TOLERANCE_MIN_UM = const(50)
TOLERANCE_MAX_UM = const(5000)
DEPTH_MAX = const(4)  # repeats within repeats
FLAGS_MAX = const(127)

LOOP = const(255)  # in place of a word's number: the nesting is wrong

# What `first_invalid` works on, an array of CHECK integers.
BUBBLES = const(0)
HEIGHT_MAX = const(1)  # µm
TICK_US = const(2)
NESTS = const(3)  # whether repeats are allowed
DEPTH = const(4)  # after the records found sound so far
OPENED = const(5)  # whether the last of them was a repeat
DEPTH_NEXT = const(6)  # the same after the records just looked at; `accept` makes them so
OPENED_NEXT = const(7)
ASKED = const(8)  # of what is not sound
LOW = const(9)
HIGH = const(10)
CRC = const(11)  # of all words accepted
CHECK = const(12)

ONE = const(32768)  # the whole way of a ramp


def flags(easing: int, until: int, then: int) -> int:
    """Word 0 of a step."""
    return STEP | easing << 2 | until << 4 | then << 5


@micropython.viper
def first_invalid(v: ptr32, c: ptr32, at: int, records: int) -> int:
    """Look at the records from `v[at]` on: record * 256 + word of the first that is not sound, -1 where all are.

    `c` is an array of CHECK integers; what was asked and what is allowed stands in its ASKED, LOW and HIGH.
    """
    n = c[BUBBLES]
    depth = c[DEPTH]
    opened = c[OPENED]
    record = 0
    while record < records:
        flag = v[at]
        kind = flag & 3
        wrong = -1
        asked = 0
        low = 0
        high = 0
        if kind == STEP:
            settle = flag >> 4 & 1
            ms = v[at + 1] + v[at + 2]
            least = (c[TICK_US] + 999) // 1000  # a step takes a tick at least
            i = 0
            while i < n and wrong < 0:
                if v[at + HEAD + i] > c[HEIGHT_MAX] and v[at + HEAD + i] != LEAVE:
                    wrong = HEAD + i
                    high = c[HEIGHT_MAX]
                i += 1
            if settle:
                if v[at + 3] < TOLERANCE_MIN_UM or v[at + 3] > TOLERANCE_MAX_UM:
                    wrong = 3
                    low = TOLERANCE_MIN_UM
                    high = TOLERANCE_MAX_UM
            elif v[at + 3]:
                wrong = 3
                high = 0
            if ms < least:
                wrong = 2
                low = least - v[at + 1]
                high = MS_MAX
            if v[at + 2] > MS_MAX:
                wrong = 2
                low = 0
                high = MS_MAX
            if v[at + 1] > MS_MAX:
                wrong = 1
                low = 0
                high = MS_MAX
            if flag > FLAGS_MAX or (settle == 0 and flag >> 5):
                wrong = 0
                low = 0
                high = FLAGS_MAX
            if wrong >= 0:
                asked = v[at + wrong]
            opened = 0
        else:
            if kind == REPEAT:
                depth += 1
            else:
                depth -= 1
            if flag > END:
                wrong = 0
                asked = flag
                high = FLAGS_MAX
            elif depth < 0 or depth > DEPTH_MAX or c[NESTS] == 0 or (kind == END and opened):
                wrong = LOOP
                asked = depth
                high = DEPTH_MAX if c[NESTS] else 0
            opened = 1 if kind == REPEAT else 0
        if wrong >= 0:
            c[ASKED] = asked
            c[LOW] = low
            c[HIGH] = high
            return record * 256 + wrong
        at += HEAD + n
        record += 1
    c[DEPTH_NEXT] = depth
    c[OPENED_NEXT] = opened
    return -1


@micropython.viper
def _accept(v: ptr32, c: ptr32, t: ptr32, at: int, end: int):  # type: ignore[no-untyped-def]
    crc = c[CRC]
    while at < end:
        crc = (crc >> 8 & 0xFFFFFF) ^ t[(crc ^ v[at]) & 255]
        crc = (crc >> 8 & 0xFFFFFF) ^ t[(crc ^ v[at] >> 8) & 255]
        at += 1
    c[CRC] = crc
    c[DEPTH] = c[DEPTH_NEXT]
    c[OPENED] = c[OPENED_NEXT]


def accept(words: "Words", check: "Words", at: int, end: int) -> None:
    """Take the records at `words[at:end]`, just found sound, as received: nesting and CRC go on from there."""
    _accept(words, check, TABLE, at, end)


def restart(check: "Words", nests: int) -> None:
    """No record has been received yet."""
    check[NESTS] = nests
    check[DEPTH] = 0
    check[OPENED] = 0
    check[CRC] = -1


@micropython.viper
def has_crc(c: ptr32, v: ptr32, at: int) -> int:
    """Whether `v[at]` is the CRC-32 of all words accepted, low byte first."""
    return 1 if ~c[CRC] == v[at] else 0


@micropython.viper
def same_word(a: ptr32, at: int, b: ptr32, bt: int) -> int:
    """Whether two words are the same; read as integers of MicroPython they could be an allocation."""
    return 1 if a[at] == b[bt] else 0


@micropython.viper
def copy_word(a: ptr32, at: int, b: ptr32, bt: int):  # type: ignore[no-untyped-def]
    """Copy one word, whatever its size."""
    b[bt] = a[at]


@micropython.viper
def small_word(v: ptr32, at: int) -> int:
    """An unsigned word as a small integer; what is none becomes the greatest."""
    word = v[at]
    return 0x3FFFFFFF if word < 0 or word > 0x3FFFFFFF else word


@micropython.viper
def ease(done: int, of: int, easing: int) -> int:
    """How far a ramp is after `done` of its ticks, in 1/32768, from 0 to 32768; at most 65535 ticks."""
    if done >= of:
        return 32768
    p = done * 32768 // of
    q = 32768 - p
    if easing == 1:  # 3p² - 2p³
        p = (p * p >> 15) * (98304 - 2 * p) >> 15
    elif easing == 2:  # p²
        p = p * p >> 15
    elif easing == 3:  # 1 - (1 - p)²
        p = 32768 - (q * q >> 15)
    return p
