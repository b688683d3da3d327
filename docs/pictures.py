"""Picture of one moment of a run: its beads coloured by speed, between the walls of its scene.

    python docs/pictures.py mini/run.h5 docs/mill.jpg [--time 0.15] [--fastest 0.9] [--upright] [--width 1400]

Needs the extra `import` (VTK) and matplotlib; draws off-screen. The near end wall of a vessel is left out, and so are
boxes and planes. Scenes whose axis is vertical are drawn `--upright`.
"""

import argparse
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import vtk
from numpy.typing import NDArray
from vtk.util.numpy_support import numpy_to_vtk

from sim import parse_scene
from sim.assembly import walls_of
from sim.motion import Bodies, move_bodies
from sim.shapes import CYLINDER, SHELL, TUBE
from suffice.store import Run

MM = 1e3  # lengths are drawn in millimetres, which suits the depth buffer
STEEL, PLATE, GLASS, INK = (0.62, 0.64, 0.67), (0.66, 0.70, 0.75), (0.45, 0.60, 0.75), (0.16, 0.19, 0.24)


class Rod(NamedTuple):
    """A cylinder as it is drawn."""

    ends: NDArray[np.float64]  # (2, 3) m
    radius: float  # m
    holds_particles: bool
    other_radius: float | None = None  # m at the second end of a hopper


def rods(walls: Bodies, depth: float) -> list[Rod]:
    """Return the cylinders of the walls where they stand now; endless ones are cut to `depth` (m)."""
    found = []
    for s, kind in enumerate(walls.kind):
        if kind not in (TUBE, CYLINDER, SHELL):
            continue
        p, b = walls.parameter[s], walls.body[s]
        half = {CYLINDER: p[7], SHELL: p[8], TUBE: depth / 2.0}[kind]
        ends = p[:3] + np.outer([-half, half], p[3:6])
        ends = (ends - walls.centre[b]) @ walls.rotation[b].T + walls.centre[b] + walls.shift[b]
        found.append(Rod(ends, float(p[6]), bool(walls.side[s] < 0), float(p[7]) if kind == SHELL else None))
    return found


def rod_actors(rod: Rod) -> list[vtk.vtkActor]:
    """Return a steel rod; or, for a vessel, its far end, its mantle of glass and its near rim."""
    if rod.other_radius is not None:
        funnel = _actor(_funnel(rod.ends, rod.radius, rod.other_radius), GLASS)
        funnel.GetProperty().SetOpacity(0.22)
        return [funnel]
    if not rod.holds_particles:
        return [_actor(_cylinder(rod.ends, rod.radius), STEEL)]
    far, near = rod.ends[np.argsort(rod.ends[:, 2])]
    thickness = 0.03 * rod.radius * (near - far) / np.linalg.norm(near - far)
    mantle = _actor(_cylinder(rod.ends, rod.radius, open_ends=True), GLASS)
    mantle.GetProperty().SetOpacity(0.13)
    end = _actor(_cylinder(np.array([far - thickness, far]), 1.04 * rod.radius), PLATE)
    rim = _actor(_ring(near, rod.radius, 1.04 * rod.radius), STEEL)
    return [end, mantle, rim]


def _cylinder(ends: NDArray[np.float64], radius: float, *, open_ends: bool = False) -> vtk.vtkTubeFilter:
    line = vtk.vtkLineSource()
    line.SetPoint1(*(MM * ends[0]))
    line.SetPoint2(*(MM * ends[1]))
    tube = vtk.vtkTubeFilter()
    tube.SetInputConnection(line.GetOutputPort())
    tube.SetRadius(MM * radius)
    tube.SetNumberOfSides(160)
    tube.SetCapping(not open_ends)
    return tube


def _funnel(ends: NDArray[np.float64], first: float, second: float) -> vtk.vtkRotationalExtrusionFilter:
    line = vtk.vtkLineSource()
    line.SetPoint1(MM * first, 0.0, MM * ends[0, 2])
    line.SetPoint2(MM * second, 0.0, MM * ends[1, 2])
    funnel = vtk.vtkRotationalExtrusionFilter()
    funnel.SetInputConnection(line.GetOutputPort())
    funnel.SetResolution(160)
    return funnel


def _ring(centre: NDArray[np.float64], inner: float, outer: float) -> vtk.vtkDiskSource:
    ring = vtk.vtkDiskSource()
    ring.SetCenter(*(MM * centre))
    ring.SetInnerRadius(MM * inner)
    ring.SetOuterRadius(MM * outer)
    ring.SetCircumferentialResolution(160)
    return ring


def _actor(source: vtk.vtkPolyDataAlgorithm, colour: tuple[float, float, float]) -> vtk.vtkActor:
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    look = actor.GetProperty()
    look.SetColor(*colour)
    look.SetAmbient(0.12)
    look.SetSpecular(0.3)
    look.SetSpecularPower(40)
    return actor


def colours(fastest: float) -> vtk.vtkLookupTable:
    """Return the colours of speeds from 0 to `fastest` (m/s)."""
    table = vtk.vtkLookupTable()
    table.SetNumberOfTableValues(256)
    table.SetRange(0.0, fastest)
    for i, colour in enumerate(mpl.colormaps["viridis"](np.linspace(0.02, 1.0, 256))):
        table.SetTableValue(i, *colour)
    return table


def bead_actor(position: NDArray[Any], radius: NDArray[Any], speed: NDArray[Any], fastest: float) -> vtk.vtkActor:
    """Return the beads as spheres of their size, coloured by speed (m/s)."""
    points = vtk.vtkPoints()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(MM * position), deep=True))
    beads = vtk.vtkPolyData()
    beads.SetPoints(points)
    for name, values in (("diameter", 2.0 * MM * radius), ("speed", speed)):
        column = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
        column.SetName(name)
        beads.GetPointData().AddArray(column)
    ball = vtk.vtkSphereSource()
    ball.SetRadius(0.5)
    ball.SetThetaResolution(32)
    ball.SetPhiResolution(24)
    mapper = vtk.vtkGlyph3DMapper()
    mapper.SetInputData(beads)
    mapper.SetSourceConnection(ball.GetOutputPort())
    mapper.SetScaleArray("diameter")
    mapper.SetScaleModeToScaleByMagnitude()
    mapper.SetScalarModeToUsePointFieldData()
    mapper.SelectColorArray("speed")
    mapper.SetLookupTable(colours(fastest))
    mapper.UseLookupTableScalarRangeOn()
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().SetSpecular(0.25)
    actor.GetProperty().SetSpecularPower(30)
    actor.GetProperty().SetAmbient(0.12)
    return actor


def scale_actor(fastest: float, width: int) -> vtk.vtkScalarBarActor:
    """Return the colour scale."""
    scale = vtk.vtkScalarBarActor()
    scale.SetLookupTable(colours(fastest))
    scale.SetTitle("speed (m/s)\n ")
    scale.SetNumberOfLabels(4)
    scale.SetLabelFormat("%.1f")
    scale.UnconstrainedFontSizeOn()
    for text, size in ((scale.GetTitleTextProperty(), 26), (scale.GetLabelTextProperty(), 24)):
        text.SetColor(*INK)
        text.SetFontSize(size * width // 1400)
        text.ItalicOff()
        text.BoldOff()
        text.ShadowOff()
    scale.SetPosition(0.86, 0.22)
    scale.SetWidth(0.1)
    scale.SetHeight(0.56)
    scale.SetBarRatio(0.28)
    return scale


def lit_scene(actors: list[vtk.vtkActor], reach: float, upright: bool) -> vtk.vtkRenderer:
    """Return a renderer with three lights and ambient occlusion, which shows how the beads lie on each other."""
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1.0, 1.0, 1.0)
    renderer.SetAutomaticLightCreation(False)
    for place, strength in (((-1.0, 2.0, 2.5), 0.85), ((2.0, 0.6, 2.0), 0.35), ((0.0, -1.0, 2.0), 0.15)):
        light = vtk.vtkLight()
        light.SetLightTypeToSceneLight()
        right, up, near = 10.0 * reach * np.array(place)
        light.SetPosition(*((right, -near, up) if upright else (right, up, near)))
        light.SetFocalPoint(0.0, 0.0, 0.0)
        light.SetIntensity(strength)
        renderer.AddLight(light)
    for actor in actors:
        renderer.AddActor(actor)
    occlusion = vtk.vtkSSAOPass()
    occlusion.SetRadius(0.15 * reach)
    occlusion.SetBias(0.012 * reach)
    occlusion.SetKernelSize(160)
    occlusion.BlurOn()
    steps = vtk.vtkRenderStepsPass()
    occlusion.SetDelegatePass(steps)
    smooth = vtk.vtkSSAAPass()
    smooth.SetDelegatePass(occlusion)
    renderer.SetPass(smooth)
    return renderer


def write_picture(renderer: vtk.vtkRenderer, path: str, size: tuple[int, int]) -> None:
    """Draw off-screen into a JPEG file."""
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.SetSize(*size)
    window.AddRenderer(renderer)
    window.Render()
    image = vtk.vtkWindowToImageFilter()
    image.SetInput(window)
    image.ReadFrontBufferOff()
    writer = vtk.vtkJPEGWriter()
    writer.SetQuality(90)
    writer.SetFileName(path)
    writer.SetInputConnection(image.GetOutputPort())
    writer.Write()


def draw(run_file: str, path: str, time: float, fastest: float, upright: bool, width: int) -> None:
    """Draw the snapshot nearest to a time (s), speeds coloured up to `fastest` (m/s)."""
    with Run(run_file) as run:
        scene = parse_scene(run.provenance["scene"], run_file)
        now = run.snapshot(int(np.abs(run.times - time).argmin()))
        radius = run.radius
    walls = walls_of(scene)
    position, velocity = now.values["position"].astype(float), now.values["velocity"].astype(float)
    depth = float(np.ptp(position[:, 2])) + 2.0 * float(radius.max())
    actors = [bead_actor(position, radius, np.linalg.norm(velocity, axis=1), fastest)]
    if walls is not None:
        move_bodies(walls, now.time)
        actors += [actor for rod in rods(walls, depth) for actor in rod_actors(rod)]
    reach = MM * float(np.abs(position[:, :2]).max())
    if upright:
        low, high = position[:, 2].min(), max(position[:, 2].max(), 0.045)
        reach, middle = 0.62 * MM * float(high - low), 0.5 * MM * float(high + low)
    renderer = lit_scene(actors, reach, upright)
    renderer.AddViewProp(scale_actor(fastest, width))
    camera = renderer.GetActiveCamera()
    if upright:
        camera.SetFocalPoint(0.16 * reach, 0.0, middle)
        camera.SetPosition(1.5 * reach, -8.4 * reach, middle + 1.6 * reach)
        camera.SetViewUp(0.0, 0.0, 1.0)
    else:
        camera.SetFocalPoint(0.16 * reach, 0.02 * reach, 0.0)
        camera.SetPosition(-2.4 * reach, 2.0 * reach, 8.2 * reach)
    camera.SetViewAngle(17.5)
    renderer.ResetCameraClippingRange()
    write_picture(renderer, path, (width, 3 * width // 4))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", help="a run.h5 of a scene with cylinders, such as that of the study `mini`")
    parser.add_argument("picture", help="JPEG file to write")
    parser.add_argument("--time", type=float, default=0.15, help="s")
    parser.add_argument("--fastest", type=float, default=0.9, help="m/s, end of the colour scale")
    parser.add_argument("--upright", action="store_true", help="the axis is vertical")
    parser.add_argument("--width", type=int, default=1400, help="pixels")
    given = parser.parse_args()
    draw(given.run, given.picture, given.time, given.fastest, given.upright, given.width)
