"""The arrows between the rooms: who may import whom, read from the source of every module."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ROOMS = ("aircraft", "fdm", "gcs", "scenarios", "trustr", "wire")
THIRD_PARTIES = {
    "numpy", "scipy", "pydantic", "pymavlink", "fastcrc", "jsbsim", "mcap", "lz4", "pymap3d", "cyclopts", "rich",
    "matplotlib", "mpl_toolkits", "joblib", "orjson", "distributed", "serial", "mcap_protobuf", "google",
    "foxglove_schemas_protobuf", "foxglove", "jinja2", "pyarrow", "imageio_ffmpeg",
}  # fmt: skip
ALLOWED = {
    "aircraft": set(),
    "trustr": {"numpy", "scipy"},
    "wire": {"pymavlink", "fastcrc", "serial"},
    "scenarios": {"pydantic", "numpy"},
    "fdm": {"wire", "scenarios", "aircraft", "jsbsim", "numpy", "pymap3d", "pymavlink", "cyclopts"},
    "gcs": {"trustr", "wire", "scenarios", "fdm"} | THIRD_PARTIES - {"jsbsim", "serial"},
}
ONLY_IN = {"fdm": "gcs/lockstep.py", "jsbsim": "fdm/vehicle.py"}
"""Of all files outside its own room, the one that may import it."""
IMPURE = {"time", "datetime", "random", "logging", "socket", "secrets", "threading", "asyncio", "os", "sys"}
LONGEST = 400

MODULES = sorted(path.relative_to(ROOT).as_posix() for room in ROOMS for path in (ROOT / room).rglob("*.py"))


def imported(module):
    """Top-level names of everything a module imports, at whatever depth."""
    names = set()
    for node in ast.walk(ast.parse((ROOT / module).read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}:{node.lineno} imports relatively"
            names.add(node.module.split(".")[0])
    return names


def python(code):
    return subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False)


def importing(modules, *, without):
    """Import modules in a fresh interpreter where others are not installed."""
    blocked = f"import sys; sys.modules.update(dict.fromkeys({list(without)}))"
    return python(f"{blocked}; import {', '.join(modules)}")


def test_every_room_has_modules():
    assert {module.split("/")[0] for module in MODULES} == set(ROOMS)


@pytest.mark.parametrize("module", MODULES)
def test_a_module_imports_only_what_its_room_may(module):
    room = module.split("/")[0]
    assert imported(module) - sys.stdlib_module_names - {room} <= ALLOWED[room]


@pytest.mark.parametrize("module", MODULES)
def test_one_file_alone_reaches_the_simulator_and_one_alone_reaches_jsbsim(module):
    room = module.split("/")[0]
    for name in imported(module) & ONLY_IN.keys() - {room}:
        assert module == ONLY_IN[name]


@pytest.mark.parametrize("module", [module for module in MODULES if module.startswith("trustr/")])
def test_trustr_has_no_clock_no_socket_no_logger_and_no_hidden_random(module):
    assert not imported(module) & IMPURE
    assert "np.random" not in (ROOT / module).read_text(encoding="utf-8")


@pytest.mark.parametrize("module", MODULES)
def test_a_module_can_be_read_in_one_sitting(module):
    assert len((ROOT / module).read_text(encoding="utf-8").splitlines()) <= LONGEST


def test_trustr_imports_with_numpy_and_scipy_alone():
    modules = sorted(f"trustr.{path.stem}" for path in (ROOT / "trustr").glob("[!_]*.py"))
    done = importing(modules, without=THIRD_PARTIES - {"numpy", "scipy"} | set(ROOMS) - {"trustr"})
    assert done.returncode == 0, done.stderr


def test_wire_imports_without_any_other_room():
    done = importing(
        ["wire.frames", "wire.payloads", "wire.modes", "wire.connection", "wire.ports", "wire.signing", "wire.clock"],
        without=set(ROOMS) - {"wire"} | {"numpy", "jsbsim"},
    )
    assert done.returncode == 0, done.stderr


def test_the_ground_station_flies_without_jsbsim_installed():
    done = importing(["gcs.live", "gcs.flight", "gcs.loop"], without={"jsbsim", "fdm", "aircraft"})
    assert done.returncode == 0, done.stderr


def test_a_blocked_package_does_fail_to_import():
    """The three tests above would notice."""
    done = importing(["gcs.lockstep"], without={"jsbsim"})
    assert "jsbsim" in done.stderr
    assert done.returncode == 1
