"""Light on surfaces of known depth and normal, and the way from rays to pixels."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from suffice.png import Pixels

Array = NDArray[np.float64]
Depths = NDArray[np.float32]

LIGHT = np.array([-0.37, 0.56, 0.74])  # of length one; from the upper left, before the picture
HALFWAY = np.array([-0.198, 0.3, 0.933])  # between the light and the eye
AMBIENT, DIFFUSE, GLOSS, SHARPNESS = 0.52, 0.66, 0.14, 24.0
DARKEST = 0.72  # of the light that a deep hole takes away
NEIGHBOURS = 28  # rays whose depth is compared
STEEPEST = 0.1  # cosine; a surface seen from its edge has next to no depth to compare
GOLDEN = 2.39996  # rad: turns by it fill a disc evenly


class Buffer(NamedTuple):
    """What each ray meets first; rows from the bottom up."""

    depth: Array  # (h, w) rays, towards the eye; −∞ where there is nothing
    normal: Array  # (h, w, 3)
    colour: Array  # (h, w, 3) from 0 to 1
    opacity: Array  # (h, w)


def blank(height: int, width: int) -> Buffer:
    """Return a buffer in which nothing is drawn."""
    shape = (height, width)
    return Buffer(np.full(shape, -np.inf), np.zeros((*shape, 3)), np.zeros((*shape, 3)), np.zeros(shape))


def pixels_of(buffer: Buffer, finer: int, reach: float) -> Pixels:
    """Return the picture (h / finer, w / finer, 4), rows from the top down.

    reach: rays, how far around a point what stands before it takes light away.
    """
    cosine = np.maximum(buffer.normal @ LIGHT, 0.0)
    gloss = GLOSS * np.maximum(buffer.normal @ HALFWAY, 0.0) ** SHARPNESS
    light = (AMBIENT + DIFFUSE * cosine) * (1.0 - DARKEST * hidden(buffer, reach))
    lit = np.clip(buffer.colour * light[..., None] + gloss[..., None], 0.0, 1.0)
    shown = np.concatenate([lit * buffer.opacity[..., None], buffer.opacity[..., None]], axis=-1)
    height, width = (n // finer for n in buffer.depth.shape)
    mean = shown.reshape(height, finer, width, finer, 4).mean(axis=(1, 3))
    mean[..., :3] /= np.maximum(mean[..., 3:], 1e-6)
    shown_pixels: Pixels = np.rint(255.0 * mean[::-1]).astype(np.uint8)
    return shown_pixels


def hidden(buffer: Buffer, reach: float) -> Array:
    """Share of the sky over each point that its neighbours hide, (h, w).

    Mean over neighbours at distances up to `reach` (rays) of the sine of the angle at which they rise over the plane
    that touches the surface.
    """
    known = np.isfinite(buffer.depth)
    filled = np.where(known, buffer.depth, -1e9).astype(np.float32)
    total = np.zeros(filled.shape, np.float32)
    facing = np.maximum(buffer.normal[..., 2], STEEPEST).astype(np.float32)
    right, up = (buffer.normal[..., k].astype(np.float32) for k in (0, 1))
    for k in range(NEIGHBOURS):
        far = reach * np.sqrt((k + 0.5) / NEIGHBOURS)
        x, y = round(far * np.cos(GOLDEN * k)), round(far * np.sin(GOLDEN * k))
        rise = _moved(filled, y, x) - filled
        over = rise * facing + x * right + y * up
        sine = over / np.sqrt(rise**2 + far**2)
        # what stands far before a point is another thing, whose shadow would float
        total += np.where((over > 0) & (rise < 3.0 * reach), sine, 0.0)
    return np.where(known, np.minimum(2.0 * total / NEIGHBOURS, 1.0), 0.0)


def _moved(field: Depths, rows: int, columns: int) -> Depths:
    """Return the field seen from each place so many rows and columns away; beyond the border nothing stands."""
    out = np.full_like(field, -1e9)
    height, width = field.shape
    if abs(rows) >= height or abs(columns) >= width:
        return out
    here = (slice(max(-rows, 0), min(height - rows, height)), slice(max(-columns, 0), min(width - columns, width)))
    there = (slice(max(rows, 0), min(height + rows, height)), slice(max(columns, 0), min(width + columns, width)))
    out[here] = field[there]
    return out
