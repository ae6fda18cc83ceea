"""Keeps a key out of texts that a server wrote, however the server spells it.

A server may echo the request, with its key, in an error or an answer: as it is, escaped for JSON,
HTML or a URL, in base64 or in hexadecimal, in UTF-16, or broken over lines. Nothing can be done
about a server that encrypts it; but that one has the key anyway.
"""

from __future__ import annotations

import base64
import html
import re
import unicodedata
from collections.abc import Iterator
from urllib.parse import unquote

MASK = '***'
WITHHELD = '(withheld, since it repeats the key)'
# A shorter key protects nothing, and masking it would damage ordinary words.
MIN_SECRET = 6
# So many characters of a key in a row are a leak. Services quote fewer, so that a user knows which
# key is meant.
LEAK = 12
# The same in other alphabets, which take four characters for three, two and about three for one.
LEAK_BASE64, LEAK_HEX, LEAK_DECIMAL = 16, 24, 30
# Escapes within escapes, at most; what has more is withheld.
MAX_DEPTH = 5

_BACKSLASH = re.compile(
    r'\\U([0-9a-fA-F]{8})|[\\%][uU]([0-9a-fA-F]{4})|\\(?:[uU]\{([0-9a-fA-F]{1,6})\}'
    r'|[xX]([0-9a-fA-F]{2})|([0-7]{3})|[bfnrtv]|(.))',
    re.DOTALL,
)
# Blanks may stand within an escape too, and in mails = breaks a line.
_BLANKS = re.compile(r'=\r?\n|\s+')
_QUOTED_PRINTABLE = re.compile(b'=([0-9a-fA-F]{2})')
# What stands between letters and digits, the colours of a terminal included.
_NO_LETTER = re.compile(r'[^0-9a-z\x1b]+|\x1b(?:\[[0-9;]*[a-z])?')


def redact(text: str, secret: str) -> str:
    """Return `text` without the secret: masked, or all withheld where it is spelt otherwise."""
    if len(secret) < MIN_SECRET:
        return text
    text = text.replace(secret, MASK)
    return WITHHELD if repeats(text, secret) else text


def repeats(text: str, secret: str) -> bool:
    """Return whether a text holds a secret, or LEAK characters of it in a row, in any spelling.

    Only letters and digits are compared, without their case, so it does not matter what stands
    between them. Linear in the length of the text.
    """
    if not text.isascii():
        text = ''.join(map(plain, text))
    parts = spellings(secret)
    for _ in range(MAX_DEPTH):
        text = _BLANKS.sub('', text)
        letters = _NO_LETTER.sub('', text.lower())
        if secret in text or any(part in letters for part in parts):
            return True
        before, text = text, unescape(text)
        if text == before:
            return False
    return True


def spellings(secret: str) -> set[str]:
    """Return the texts of lower-case letters and digits of which none may appear."""
    found = set(windows(secret, LEAK))
    # An escape that is part of the key is decoded with the others.
    found |= set(windows(unescape(secret), LEAK))
    for encoding in ('utf-8', 'utf-16-le', 'utf-16-be'):
        data = secret.encode(encoding)
        found |= set(windows(data.hex(), LEAK_HEX))
        found |= set(windows(''.join(map(str, data)), LEAK_DECIMAL))
        # What stands before it decides how the bytes fall into groups of three. The first and the
        # last characters depend on the neighbours.
        for before in range(3):
            coded = base64.b64encode(bytes(before) + data).decode().rstrip('=')
            found |= set(windows(coded[before + 1 if before else 0 : -1], LEAK_BASE64))
    return found


def windows(text: str, length: int) -> Iterator[str]:
    """Return all parts of so many letters and digits, or the one whole that is shorter."""
    letters = _NO_LETTER.sub('', text.lower())
    if len(letters) >= MIN_SECRET:
        for start in range(max(1, len(letters) - length + 1)):
            yield letters[start : start + length]


def unescape(text: str) -> str:
    """Undo one level of escapes: of JSON and programming languages, URLs, HTML and mails."""
    text = html.unescape(unquote(_BACKSLASH.sub(unescaped, text)))
    data = _QUOTED_PRINTABLE.sub(
        lambda found: bytes.fromhex(found[1].decode()), text.encode(errors='replace')
    )
    text = data.decode(errors='replace')
    return text if text.isascii() else ''.join(map(plain, text))


def unescaped(found: re.Match[str]) -> str:
    """Return the character that an escape with a backslash stands for."""
    *numbers, octal, letter = found.groups()
    code = next((int(number, 16) for number in numbers if number), None)
    if code is None:
        return chr(int(octal, 8)) if octal else letter or ''
    return chr(code) if code < 0x110000 else ''


def plain(letter: str) -> str:
    """Return a character without its accents and width: full-width letters become ASCII.

    One that is not seen, such as a joiner of no width, becomes nothing.
    """
    if letter.isascii():
        return letter
    # One by one, since normalising a long run of accents takes quadratic time.
    return unicodedata.normalize('NFKD', letter) if letter.isprintable() else ''
