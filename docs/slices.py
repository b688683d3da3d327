"""Picture of a slice through particles and fluid at one moment of a run.

    python docs/slices.py mini/run.h5 docs/mill_slice.jpg [--across z] [--at 0.0] [--time 0.15]

Left the speed of the fluid with its streamlines, right the void fraction with the particles that the slice cuts.
"""

import argparse
from math import sqrt

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from suffice.store import Run

MM = 1e3
INK = "#28313d"


def slice_figure(run: Run, time: float, across: int, at: float) -> Figure:
    """Draw the cells and particles at a coordinate (m) across an axis, of the snapshot nearest to a time (s)."""
    if run.grid is None:
        raise SystemExit(f"{run.path} holds no fluid")
    now = run.snapshot(int(np.abs(run.times - time).argmin()))
    right, up = [axis for axis in range(3) if axis != across]
    low, h = run.grid.origin, run.grid.spacing
    cells = run.grid.shape[::-1]
    k = min(max(int((at - low[across]) / h[across]), 0), cells[across] - 1)
    velocity = now.values["fluid.velocity"].take(k, axis=2 - across)
    void = now.values["fluid.void_fraction"].take(k, axis=2 - across)
    box = [MM * edge for a in (right, up) for edge in (low[a], low[a] + cells[a] * h[a])]
    tall = (box[3] - box[2]) / (box[1] - box[0])
    figure, (left, other) = plt.subplots(1, 2, figsize=(10.5, 0.6 + 4.2 * min(tall, 1.3)), layout="constrained")
    speed = np.linalg.norm(velocity, axis=-1)
    shown = left.imshow(speed, origin="lower", extent=box, cmap="viridis", interpolation="bilinear")
    _label(left, figure, shown, "speed of the fluid (m/s)", "xyz"[right], "xyz"[up])
    along = [MM * (low[a] + (np.arange(cells[a]) + 0.5) * h[a]) for a in (right, up)]
    u, v = (np.ma.masked_array(velocity[..., a], speed < 0.05 * speed.max()) for a in (right, up))
    left.streamplot(*along, u, v, color="white", linewidth=0.6, density=1.1, arrowsize=0.7)
    shown = other.imshow(void, origin="lower", extent=box, cmap="Blues_r", vmin=0.3, vmax=1.0)
    _label(other, figure, shown, "void fraction", "xyz"[right], "xyz"[up])
    if "position" in now.values:
        _cut(other, now.values["position"].astype(float), run.radius, across, at, (right, up))
    for axes in (left, other):
        axes.set_xlim(*box[:2])
        axes.set_ylim(*box[2:])
    figure.suptitle(f"{'xyz'[across]} = {MM * at:g} mm, t = {now.time:.3f} s", fontsize=10, color=INK)
    return figure


def _cut(
    axes: Axes,
    position: NDArray[np.float64],
    radius: NDArray[np.float64],
    across: int,
    at: float,
    shown: tuple[int, int],
) -> None:
    """Draw the circles in which the slice cuts the particles."""
    beyond = np.abs(position[:, across] - at)
    cut = beyond < radius
    size = 2.0 * MM * np.sqrt(radius[cut] ** 2 - beyond[cut] ** 2)
    circles = EllipseCollection(
        size, size, np.zeros_like(size), units="xy", offsets=MM * position[cut][:, shown],
        offset_transform=axes.transData, facecolor="#d98032", edgecolor="#6b3a10", linewidth=0.3,
    )  # fmt: skip
    axes.add_collection(circles)


def _label(axes: Axes, figure: Figure, shown: AxesImage, name: str, right: str, up: str) -> None:
    axes.set_title(name, fontsize=10, color=INK)
    axes.set_xlabel(f"{right} (mm)")
    axes.set_ylabel(f"{up} (mm)")
    figure.colorbar(shown, ax=axes, shrink=sqrt(0.6), pad=0.02)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", help="a run.h5 of a scene with a fluid")
    parser.add_argument("picture", help="file to write: .jpg, .png or .svg")
    parser.add_argument("--across", choices="xyz", default="z", help="direction across the slice")
    parser.add_argument("--at", type=float, default=0.0, help="m, where along it")
    parser.add_argument("--time", type=float, default=0.15, help="s")
    given = parser.parse_args()
    with Run(given.run) as opened:
        slice_figure(opened, given.time, "xyz".index(given.across), given.at).savefig(given.picture, dpi=130)
