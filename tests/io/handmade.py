"""Encoded pictures made by hand, where no library writes the variant that a test is about."""

from __future__ import annotations

import struct
import zlib
from io import BytesIO

import numpy as np
from PIL import Image

GREY, COLOUR, PALETTE, GREY_ALPHA, COLOUR_ALPHA = 0, 2, 3, 4, 6


def png_chunk(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))


def png(samples: np.ndarray, bits: int, colour_type: int, **chunks: bytes) -> bytes:
    """A PNG made by hand, from (H, W) or (H, W, C) samples; ``bits`` below 8 takes a width that fills bytes."""
    height, width = samples.shape[:2]
    flat = samples.reshape(height, -1)
    if bits < 8:
        wide = np.unpackbits(flat.astype(np.uint8)[..., np.newaxis], axis=-1)[..., 8 - bits :]
        rows = [np.packbits(row).tobytes() for row in wide.reshape(height, -1)]
    else:
        rows = [row.astype(">u1" if bits == 8 else ">u2").tobytes() for row in flat]
    header = struct.pack(">IIBBBBB", width, height, bits, colour_type, 0, 0, 0)
    extra = b"".join(png_chunk(name.encode(), content) for name, content in chunks.items())
    body = zlib.compress(b"".join(b"\0" + row for row in rows))
    return (
        b"\x89PNG\r\n\x1a\n" + png_chunk(b"IHDR", header) + extra + png_chunk(b"IDAT", body) + png_chunk(b"IEND", b"")
    )


def saved(image: Image.Image, **options: object) -> bytes:
    stream = BytesIO()
    image.save(stream, **options)
    return stream.getvalue()


def levels(*shape: int, bits: int = 8, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 2**bits, shape).astype(np.uint8 if bits <= 8 else np.uint16)
