"""What other codes call things."""

import pytest

from suffice.readers.names import CELLS, PARTICLES, find_names, parse_map
from suffice.refusal import Refusal


@pytest.mark.parametrize(
    ("code", "known", "found"),
    [
        (
            "LIGGGHTS",
            ["id", "type", "v", "f", "radius", "omega"],
            {"id": "id", "species": "type", "velocity": "v", "radius": "radius", "angular_velocity": "omega"},
        ),
        (
            "Yade",
            ["radii", "id", "linVelVec", "angVelVec", "linVelLen", "angVelLen"],
            {"id": "id", "radius": "radii", "velocity": "linVelVec", "angular_velocity": "angVelVec"},
        ),
        ("MFiX", ["Diameter", "Velocity", "ID"], {"id": "ID", "diameter": "Diameter", "velocity": "Velocity"}),
        (
            "OpenFOAM",
            ["U", "UTurb", "d", "dTarget", "origId", "origProcId", "typeId"],
            {"id": "origId", "velocity": "U", "diameter": "d", "species": "typeId"},
        ),
    ],
)
def test_particles_are_known_by_the_names_of_their_code(code, known, found):
    assert find_names(known, PARTICLES, {}, code) == {what: (name,) for what, name in found.items()}


def test_fields_are_known_with_their_phase_and_unit():
    known = ["U.air [m/s]", "alpha.air [-]", "mu.air [kg/(m s)]", "p [m2/s2]", "p_rgh [Pa]"]
    assert find_names(known, CELLS, {}, "OpenFOAM") == {
        "fluid.velocity": ("U.air [m/s]",),
        "fluid.pressure": ("p [m2/s2]",),
        "fluid.void_fraction": ("alpha.air [-]",),
    }
    found = find_names(["EP_G", "P_G", "U_G", "V_G", "W_G"], CELLS, {}, "MFiX")
    assert found["fluid.velocity"] == ("U_G", "V_G", "W_G")
    assert found["fluid.void_fraction"] == ("EP_G",)


def test_two_phases_are_not_guessed_between():
    with pytest.raises(Refusal, match=r"U.air and U.water may be fluid.velocity; .* --map fluid.velocity=U.air"):
        find_names(["U.air", "U.water"], CELLS, {}, "case")
    mapped = {"fluid.velocity": "U.water"}
    assert find_names(["U.air", "U.water"], CELLS, mapped, "case") == {"fluid.velocity": ("U.water",)}
    with pytest.raises(Refusal, match=r"--map fluid.velocity=U.oil: case has no such array; it has U.air, U.water"):
        find_names(["U.air", "U.water"], CELLS, {"fluid.velocity": "U.oil"}, "case")


@pytest.mark.parametrize("text", ["velocity", "velocity=", "speed=v", "=v", ""])
def test_a_mapping_that_is_not_understood_is_refused(text):
    with pytest.raises(Refusal, match=r"write WHAT=NAME, WHAT one of id, velocity"):
        parse_map([text])


def test_a_mapping_given_twice_is_refused():
    with pytest.raises(Refusal, match="--map velocity is given twice"):
        parse_map(["velocity=v", "velocity=u"])
