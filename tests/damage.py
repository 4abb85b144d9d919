"""Damage to files, the same for the same seed: to their bytes, and to what JSON says."""

from __future__ import annotations

import copy
import json
import math
import random
from typing import Any

ODD: list[Any] = [
    *(None, True, -1, 0, 0.5, 1, 2, 3, 1e9, 1e300, -1e300, 1e-320, -0.0, 2**63, 10**400),
    *(math.nan, math.inf, "", "x", "\0", "\ud800", [], [[]], {}, [[[[1]]]], [1] * 999, "y" * 9999),
]
"""What no entry of a file should be, or few."""


def damaged_bytes(content: bytes, draw: random.Random) -> bytes:
    """Return bytes with flipped bits, other bytes, other words, a missing end, repeated pieces."""
    data = bytearray(content)
    size = len(data)
    place = draw.randrange(size - 64)
    match draw.randrange(6):
        case 0:
            for _ in range(draw.choice((1, 2, 20))):
                data[draw.randrange(size)] ^= 1 << draw.randrange(8)
        case 1:
            for _ in range(draw.choice((1, 5, 20))):
                data[draw.randrange(size)] = draw.choice((0, 1, 34, 57, 91, 127, 128, 255))
        case 2:
            del data[place:]
        case 3:
            data[place:] = bytes(size - place)
        case 4:
            word = draw.choice((0, 2**64 - 1, 2**63, 2**40, size, draw.randrange(size)))
            data[place & ~7 : (place & ~7) + 8] = word.to_bytes(8, "little")
        case _:
            other = draw.randrange(size - 64)
            data[place : place + 64] = data[other : other + 64]
    return bytes(data)


def damaged_json(content: bytes, draw: random.Random) -> bytes:
    """Return JSON that is still JSON, with odd, missing, too many or too few entries."""
    data = copy.deepcopy(json.loads(content))
    for _ in range(draw.choice((1, 1, 2))):
        key = draw.choice(list(data))
        value = data[key]
        match draw.randrange(4):
            case 0:
                del data[key]
            case 1 if isinstance(value, list) and value:
                data[key] = draw.choice((value[:-1], value * 2, value[::-1]))
            case 2 if isinstance(value, list | dict) and value:
                place = draw.choice(list(value) if isinstance(value, dict) else range(len(value)))
                value[place] = draw.choice(ODD)
            case _:
                data[key] = draw.choice(ODD)
    return json.dumps(data).encode("utf-8", "surrogatepass")
