"""Keep keys out of everything that is shown, logged or recorded."""

MASK = '***'
# A shorter key guards nothing, and masking it would maul ordinary words.
MIN_SECRET = 6


def redact(text: str, secret: str) -> str:
    """Return `text` with the secret masked."""
    return text.replace(secret, MASK) if len(secret) >= MIN_SECRET else text


def redact_bytes(data: bytes, secret: str) -> bytes:
    """Return `data` with the secret masked: before it is cut anywhere, which could halve it."""
    return data.replace(secret.encode(), MASK.encode()) if len(secret) >= MIN_SECRET else data
