# 30 beads of two sizes fall into a box of 20 mm and settle; Yade 2023.02a, SI units.
#   mkdir out; yade -n -x -j1 shaken.py; tar cf - out | xz -9e > shaken.tar.xz
from yade import pack

material = O.materials.append(FrictMat(young=5e6, poisson=0.3, density=2500, frictionAngle=0.3))
O.bodies.append(geom.facetBox((0.01, 0.01, 0.015), (0.01, 0.01, 0.015), material=material))
beads = pack.SpherePack()
beads.makeCloud((0.001, 0.001, 0.001), (0.019, 0.019, 0.029), rMean=0.00125, rRelFuzz=0.2, num=30, seed=7)
beads.toSimulation(material=material)
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb(), Bo1_Facet_Aabb()]),
    InteractionLoop(
        [Ig2_Sphere_Sphere_ScGeom(), Ig2_Facet_Sphere_ScGeom()],
        [Ip2_FrictMat_FrictMat_FrictPhys()],
        [Law2_ScGeom_FrictPhys_CundallStrack()],
    ),
    NewtonIntegrator(gravity=(2.9, 0, -9.8), damping=0.1),
    VTKRecorder(fileName="out/shaken-", recorders=["spheres", "id", "velocity"], iterPeriod=300, ascii=False),
]
O.dt = 1e-5
O.run(12000, wait=True)
