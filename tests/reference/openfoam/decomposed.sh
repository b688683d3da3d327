# The case of box.sh for 0.1 s on three processors in binary, only its last time put together again; OpenFOAM v1912.
#   bash decomposed.sh      beside box.sh: writes the case into box/, runs it and packs decomposed.tar.xz
set -e
sed '/^blockMesh/,$d' box.sh | bash
cd box
sed -i 's/endTime 0.2/endTime 0.1/; s/writeInterval 0.005/writeInterval 0.01/; s/ascii; writePrecision/binary; writePrecision/' \
    system/controlDict
cat > system/decomposeParDict <<EOF
FoamFile
{ version 2.0; format ascii; class dictionary; object decomposeParDict; }
numberOfSubdomains 3; method simple; simpleCoeffs { n (3 1 1); delta 0.001; }
EOF
blockMesh > log.mesh
decomposePar > log.dec
mpirun -n 3 DPMFoam -parallel > log
sed -i 's/binary; writePrecision/ascii; writePrecision/' system/controlDict
reconstructPar -latestTime > log.rec
# fluxes, material fields and collision records are not read
for root in . processor*; do
    (cd $root && rm -rf 0*/uniform 0.*/*.air_0 0.*/phi.air 0.*/mu.air 0.*/rho.air 0.*/kinematicCloud:* constant/polyMesh/*Addressing)
done
find . -path "*/kinematicCloud/*" | grep -vE "/(positions|U|d|origId|origProcId)$" | xargs rm -f
cd ..
tar cf - box/0 box/0.* box/constant/polyMesh box/system/controlDict box/processor* | xz -9e > decomposed.tar.xz
