"""The quadrotor's files against each other: what the README says is what JSBSim reads."""

import re
import xml.etree.ElementTree as ET
from math import pi, tan

import jsbsim
import pytest

import aircraft

QUAD = aircraft.folder() / "quad"
SYSTEMS = sorted((QUAD / "Systems").glob("*.xml"))


def declared() -> dict[str, float]:
    """Every parameter of the XML by name."""
    root = ET.parse(QUAD / "Systems" / "parameters.xml").getroot()
    return {node.text.removeprefix("params/"): float(node.get("value")) for node in root.iter("property")}


PARAMETERS = declared()


def test_the_models_are_data_of_the_package():
    assert (QUAD / "quad.xml").is_file()
    assert [path.stem for path in SYSTEMS] == ["battery", "control", "parameters", "rotors"]


def test_the_readme_gives_every_parameter_its_value_and_a_source():
    rows = re.findall(r"^\| `([a-z0-9-]+)` \| ([^|]+) \| [^|]+ \| ([^|]+) \|$", (QUAD / "README.md").read_text(), re.M)
    assert {name: float(value) for name, value, _ in rows} == PARAMETERS
    assert all(source.strip() for *_, source in rows)


def test_parameters_written_out_follow_from_the_others():
    p = PARAMETERS
    assert p["force-per-tilt-torque"] == pytest.approx(1 / (4 * p["arm-m"]))
    assert p["force-per-yaw-torque"] == pytest.approx(1 / (4 * p["torque-per-thrust-m"]))
    assert p["idle-force"] == pytest.approx(p["thrust-coefficient"] * p["idle-rotor-speed"] ** 2)
    assert p["speed2-per-force"] == pytest.approx(1 / p["thrust-coefficient"])
    assert p["max-tilt-tan"] == pytest.approx(tan(35 * pi / 180), rel=1e-4)


def test_the_controller_knows_the_mass_and_the_shape_of_the_airframe():
    root = ET.parse(QUAD / "quad.xml").getroot()
    assert float(root.findtext("mass_balance/emptywt")) == PARAMETERS["mass-kg"]
    assert (
        float(root.findtext("external_reactions/force/location/z"))
        == PARAMETERS["rotor-height-m"]
        == max(float(node.text) for node in root.findall("ground_reactions/contact/location/z"))
    )


def test_it_stands_where_its_legs_carry_its_weight():
    contact = ET.parse(QUAD / "quad.xml").getroot().find("ground_reactions/contact")
    sag = PARAMETERS["mass-kg"] * 9.80665 / (4 * float(contact.findtext("spring_coeff")))
    legs = -float(contact.findtext("location/z"))
    assert PARAMETERS["standing-height-m"] == pytest.approx(legs - sag, abs=1e-4)


def test_contacts_are_structure_only():
    contacts = ET.parse(QUAD / "quad.xml").getroot().findall("ground_reactions/contact")
    assert len(contacts) == 8
    assert {contact.get("type") for contact in contacts} == {"STRUCTURE"}


@pytest.fixture(scope="module")
def properties():
    fdm = jsbsim.FGFDMExec(None)
    for set_path in (fdm.set_aircraft_path, fdm.set_engine_path, fdm.set_systems_path):
        set_path(str(aircraft.folder()))
    assert fdm.load_model("quad")
    return fdm.query_property_catalog("")


COMPONENTS = ("pid", "integrator", "lag_filter", "actuator")  # the catalogue omits these outputs
READERS = ("property", "input", "trigger", "kp", "ki", "rate_limit", "lag", "min", "max", "independentVar")


@pytest.mark.parametrize("path", [QUAD / "quad.xml", *SYSTEMS], ids=lambda path: path.stem)
def test_every_property_that_the_xml_reads_exists(path, properties):
    known = {line.split(" (")[0] for line in properties.splitlines()}
    known |= {node.get("name") for file in SYSTEMS for node in ET.parse(file).iter() if node.tag in COMPONENTS}
    read = {node.text.strip().lstrip("-") for node in ET.parse(path).iter() if node.tag in READERS and node.text}
    assert {name for name in read if re.search("[a-z]/", name)} - known == set()
