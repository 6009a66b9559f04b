"""Seeded damage to valid inputs: text and bytes."""

import re

import numpy as np

NUMBERS = (
    *("0", "-1", "1", "nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "1e29", "100000", "2147483648"),
    *("9" * 40, "-0.0", "true", '""', '"nan"', "[]", "{}", "[[]]", "1979-05-27", "0x7fffffff", "1_000_000"),
)
SNIPPETS = (
    *(
        "\0",
        "\ufeff",
        "\U0001f4a5",
        "é" * 50,
        "\n",
        "\r",
        '"',
        "'",
        '"""',
        "[",
        "]",
        "{",
        "}",
        "=",
        ",",
        "#",
        "\\",
    ),
    *(
        "../../../../etc/passwd",
        "/dev/zero",
        "%s%n",
        "a." * 50,
        "[" * 60,
        "{a=" * 20,
        "[[bodies]]\n",
        "x" * 5000,
    ),
)
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
EXTREME_BYTES = (
    b"\0\0\0\0",
    b"\xff\xff\xff\xff",
    b"\x7f\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\0\0\0\x80",
    b"\x80\0\0\0",
)


def damaged_text(valid: str, random: np.random.Generator) -> str:
    """The text with one or two of: another number, a snippet, a line removed, repeated or moved, a cut."""
    text = valid
    for _ in range(random.integers(1, 3)):
        text = _damaged_once(text, random)
    return text


def _damaged_once(text: str, random: np.random.Generator) -> str:
    lines, place = text.split("\n"), int(random.integers(len(text) + 1))
    line = int(random.integers(len(lines)))
    match random.integers(8):
        case 0 | 1 | 2:
            numbers = list(_NUMBER.finditer(text))
            if not numbers:
                return text
            found = numbers[random.integers(len(numbers))]
            return text[: found.start()] + str(random.choice(NUMBERS)) + text[found.end() :]
        case 3:
            return text[:place] + SNIPPETS[random.integers(len(SNIPPETS))] + text[place:]
        case 4:
            return "\n".join(lines[:line] + lines[line + 1 :])
        case 5:
            return "\n".join(
                lines[:line] + lines[line : line + 1] * int(random.integers(2, 40)) + lines[line + 1 :]
            )
        case 6:
            other = int(random.integers(len(lines)))
            lines[line], lines[other] = lines[other], lines[line]
            return "\n".join(lines)
    return text[:place]


def damaged_bytes(valid: bytes, random: np.random.Generator) -> bytes:
    """The bytes with one to six of: changed bits, an extreme number, a cut, a part removed or repeated."""
    content = bytearray(valid)
    for _ in range(random.integers(1, 7)):
        size = len(content)
        if size < 8:
            break
        # half of the damage is at the beginning, where the headers are
        place = int(random.integers(min(size, 200) if random.random() < 0.5 else size))
        match random.integers(6):
            case 0 | 1:
                content[place] ^= 1 << int(random.integers(8))
            case 2:
                content[place : place + 4] = EXTREME_BYTES[random.integers(len(EXTREME_BYTES))]
            case 3:
                content[place] = int(random.integers(256))
            case 4:
                end = min(place + int(random.integers(1, 500)), size)
                content[place:place] = content[place:end]
            case 5:
                if random.random() < 0.3:
                    del content[place:]
                else:
                    del content[place : place + int(random.integers(1, 50))]
    return bytes(content)
