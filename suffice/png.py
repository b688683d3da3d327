"""PNG files of few colours, written without a library."""

import struct
import zlib
from base64 import b64encode

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]
Array = NDArray[np.float64]

SIGNATURE = b"\x89PNG\r\n\x1a\n"
COLOURS = 256  # an index is a byte
COARSE = np.array([6, 6, 6, 17], np.uint8)  # steps of red, green, blue and opacity that are told apart at first
ROUNDS = 4  # in which each kept colour moves to the mean of those it stands for (Lloyd)
BLOCK = 4096  # colours whose nearest one is looked for at once
LEVEL = 9


def png_of(pixels: Pixels) -> bytes:
    """Return pixels (height, width, 4), red, green, blue and opacity from 0 to 255, as an indexed PNG.

    At most 256 colours are kept: from the most frequent ones, moved to where they stand for all others best.
    """
    height, width = pixels.shape[:2]
    palette, index = _palette(np.ascontiguousarray(pixels))
    rows = np.hstack(
        [np.zeros((height, 1), np.uint8), index.reshape(height, width)]
    )  # no filter: indices are no levels
    return SIGNATURE + b"".join(
        (
            _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)),
            _chunk(b"PLTE", palette[:, :3].tobytes()),
            _chunk(b"tRNS", palette[:, 3].tobytes()),
            _chunk(b"IDAT", zlib.compress(rows.tobytes(), LEVEL)),
            _chunk(b"IEND", b""),
        )
    )


def data_uri(png: bytes) -> str:
    """Return a PNG as a URI that a page holds in itself."""
    return f"data:image/png;base64,{b64encode(png).decode('ascii')}"


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def _palette(pixels: Pixels) -> tuple[Pixels, Pixels]:
    """Return colours (k, 4), k at most 256, and the index of every pixel among them, (height · width,)."""
    flat = pixels.reshape(-1, 4) * (pixels.reshape(-1, 4)[:, 3:] > 0)  # nothing is seen of a clear pixel's colour
    if len(exact := np.unique(flat.view(np.uint32))) <= COLOURS:
        return _split(exact), np.searchsorted(exact, flat.view(np.uint32).ravel()).astype(np.uint8)
    _, place, count = np.unique((flat // COARSE).view(np.uint32), return_inverse=True, return_counts=True)
    place = place.ravel()
    found = np.stack([np.bincount(place, c) for c in flat.T], axis=1) / count[:, None]
    kept = _median_cut(found, count)
    for _ in range(ROUNDS):
        nearest = _nearest(found, kept)
        weight = np.bincount(nearest, count, len(kept))
        mean = np.stack([np.bincount(nearest, count * c, len(kept)) for c in found.T], axis=1)
        kept = np.where(weight[:, None] > 0, mean / np.maximum(weight, 1.0)[:, None], kept)
    return np.rint(kept).astype(np.uint8), _nearest(found, kept).astype(np.uint8)[place]


def _median_cut(colours: Array, count: NDArray[np.intp]) -> Array:
    """Return the means of up to 256 boxes of colours (k, 4): of those there are, the widest is halved each time."""
    boxes = [np.arange(len(colours))]
    weights = [_width(colours, count, boxes[0])]
    for _ in range(min(COLOURS, len(colours)) - 1):
        box = boxes.pop(at := int(np.argmax(weights)))
        weights.pop(at)
        order = box[np.argsort(colours[box, np.ptp(colours[box], axis=0).argmax()], kind="stable")]
        below = np.cumsum(count[order])
        half = min(max(int(np.searchsorted(below, below[-1] / 2.0)), 1), len(order) - 1)
        boxes += [order[:half], order[half:]]
        weights += [_width(colours, count, each) for each in boxes[-2:]]
    return np.array([np.average(colours[box], axis=0, weights=count[box]) for box in boxes])


def _width(colours: Array, count: NDArray[np.intp], box: NDArray[np.intp]) -> float:
    """Weigh a box by how wide it is and by how many pixels it holds; one of a single colour cannot be halved."""
    return float(np.ptp(colours[box], axis=0).max() * count[box].sum() ** 0.5) if len(box) > 1 else -1.0


def _split(colours: NDArray[np.uint32]) -> Pixels:
    return np.ascontiguousarray(colours).view(np.uint8).reshape(-1, 4)


def _nearest(colours: Array, palette: Array) -> NDArray[np.intp]:
    """Return the index of the nearest of the palette for each colour."""
    half = 0.5 * np.square(palette).sum(axis=1)
    starts = range(0, len(colours), BLOCK)
    return np.concatenate([(half - colours[start : start + BLOCK] @ palette.T).argmin(axis=1) for start in starts])
