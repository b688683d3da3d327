# 64 beads of 2.5 mm in a closed column of 15 x 15 x 45 mm that air lifts from below; OpenFOAM v1912, SI units.
#   bash box.sh      writes the case into box/, runs it, keeps what suffice reads and packs box.tar.xz
set -e
mkdir -p box/0 box/constant box/system
cd box

file() { # CLASS PLACE/NAME: a dictionary from standard input
    { printf 'FoamFile\n{ version 2.0; format ascii; class %s; object %s; }\n' "$1" "$(basename "$2")"; cat; } > "$2"
}

file dictionary system/controlDict <<EOF
application DPMFoam;
startFrom startTime; startTime 0; stopAt endTime; endTime 0.2; deltaT 5e-5;
writeControl runTime; writeInterval 0.005; writeFormat ascii; writePrecision 8; timePrecision 6;
EOF
file dictionary system/blockMeshDict <<EOF
scale 0.001;
vertices
(
    (-7.5 -7.5 0) (7.5 -7.5 0) (7.5 7.5 0) (-7.5 7.5 0) (-7.5 -7.5 45) (7.5 -7.5 45) (7.5 7.5 45) (-7.5 7.5 45)
);
blocks (hex (0 1 2 3 4 5 6 7) (3 3 9) simpleGrading (1 1 1));
edges ();
boundary
(
    top { type wall; faces ((4 5 6 7)); }
    bottom { type wall; faces ((0 1 2 3)); }
    sides { type wall; faces ((0 1 5 4) (2 3 7 6) (1 2 6 5) (3 0 4 7)); }
);
EOF
file dictionary system/fvSchemes <<EOF
ddtSchemes { default Euler; }
gradSchemes { default Gauss linear; }
divSchemes { default Gauss upwind; div(((alpha.air*nuEff.air)*dev2(T(grad(U.air))))) Gauss linear; }
laplacianSchemes { default Gauss linear corrected; }
interpolationSchemes { default linear; }
snGradSchemes { default corrected; }
EOF
file dictionary system/fvSolution <<EOF
solvers
{
    "p.*" { solver PCG; preconditioner DIC; tolerance 1e-8; relTol 0; }
    "U.air.*" { solver smoothSolver; smoother symGaussSeidel; tolerance 1e-8; relTol 0; }
}
PIMPLE { nOuterCorrectors 1; nCorrectors 2; momentumPredictor yes; }
EOF
file dictionary constant/transportProperties <<EOF
continuousPhase air; rho.air 1.2; transportModel Newtonian; nu 1e-5;
EOF
file dictionary constant/turbulenceProperties.air <<EOF
simulationType laminar;
EOF
file uniformDimensionedVectorField constant/g <<EOF
dimensions [0 1 -2 0 0 0 0]; value (0 0 -9.81);
EOF
file volVectorField 0/U.air <<EOF
dimensions [0 1 -1 0 0 0 0]; internalField uniform (0 0 0);
boundaryField
{
    sides { type noSlip; }
    top { type pressureInletOutletVelocity; phi phi.air; value uniform (0 0 0); }
    bottom { type interstitialInletVelocity; inletVelocity uniform (0 0 1.9); value uniform (0 0 1.9); phi phi.air; alpha alpha.air; }
}
EOF
file volScalarField 0/p <<EOF
dimensions [0 2 -2 0 0 0 0]; internalField uniform 0;
boundaryField
{
    "sides|bottom" { type fixedFluxPressure; phi phi.air; value uniform 0; }
    top { type fixedValue; value uniform 0; }
}
EOF
{
    echo "("
    for z in 2 5 8 11; do for y in -4.5 -1.4 1.6 4.6; do for x in -4.4 -1.5 1.5 4.7; do
        echo "(${x}e-3 ${y}e-3 $z.${y#*.}e-3)"
    done; done; done
    echo ")"
} | file vectorField constant/beads
file dictionary constant/kinematicCloudProperties <<EOF
solution
{
    active true; coupled true; transient yes; cellValueSourceCorrection off;
    interpolationSchemes { rho.air cell; U.air cellPoint; mu.air cell; }
    integrationSchemes { U Euler; }
    sourceTerms { schemes { U semiImplicit 1; } }
}
constantProperties { rho0 2500; youngsModulus 1e7; poissonsRatio 0.3; constantVolume false; alphaMax 0.99; }
subModels
{
    particleForces { ErgunWenYuDrag { alphac alpha.air; } gravity; }
    injectionModels
    {
        beads
        {
            type manualInjection; massTotal 0; parcelBasisType fixed; nParticle 1; SOI 0; U0 (0 0 0);
            positionsFile "beads";
            sizeDistribution { type fixedValue; fixedValueDistribution { value 0.0025; } }
        }
    }
    dispersionModel none; heatTransferModel none; surfaceFilmModel none; stochasticCollisionModel none; radiation off;
    patchInteractionModel localInteraction;
    localInteractionCoeffs { patches ( ".*" { type rebound; e 0.9; mu 0.1; } ); }
    collisionModel pairCollision;
    pairCollisionCoeffs
    {
        maxInteractionDistance 0.0025; writeReferredParticleCloud no;
        pairModel pairSpringSliderDashpot;
        pairSpringSliderDashpotCoeffs
        { useEquivalentSize no; alpha 0.02; b 1.5; mu 0.1; cohesionEnergyDensity 0; collisionResolutionSteps 12; }
        wallModel wallSpringSliderDashpot;
        wallSpringSliderDashpotCoeffs
        {
            useEquivalentSize no; collisionResolutionSteps 12; youngsModulus 1e7; poissonsRatio 0.3; alpha 0.02; b 1.5;
            mu 0.1; cohesionEnergyDensity 0;
        }
        U U.air;
    }
}
cloudFunctions {}
EOF
blockMesh > log.mesh
DPMFoam > log
# fluxes, material fields and collision records are not read
rm -rf 0.*/uniform 0.*/*.air_0 0.*/phi.air 0.*/mu.air 0.*/rho.air 0.*/kinematicCloud:*
for cloud in 0.*/lagrangian/kinematicCloud; do
    (cd "$cloud" && ls | grep -vxE "positions|coordinates|U|d|origId|origProcId|age" | xargs rm -f)
done
cd ..
tar cf - box/0 box/0.* box/constant/polyMesh box/system/controlDict | xz -9e > box.tar.xz
