"""A fresh controller of each model for every test."""

import os

import pytest

pytest.register_assert_rewrite("control", "controller", "foreign", "rig", "smd3", "smsd_usb", "wire")

from controller import Pymodbus
from rig import Rig


def pytest_configure():
    if "STEPDRIVE" not in os.environ:
        pytest.exit("STEPDRIVE must name the stepdrive program; `cargo xtask test` sets it", returncode=2)


@pytest.fixture(params=["SMSD-4.2LAN", "SMSD-8.0LAN"])
def model(request) -> str:
    return request.param


@pytest.fixture
def rig(tmp_path, model):
    """A running rig. It must still be running when the test is over, and end with 0."""
    rig = Rig(tmp_path, model)
    try:
        rig.start()
        yield rig
        assert rig.is_running(), rig.complaints()
        rig.stop()
    finally:
        rig.clean_up()


@pytest.fixture
def connect(rig):
    """Opens connections to the rig by pymodbus, and closes them when the test is over."""
    opened = []

    def open_one(unit=1) -> Pymodbus:
        client = Pymodbus(rig.port, unit)
        opened.append(client)
        return client

    yield open_one
    for client in opened:
        client.close()


@pytest.fixture
def stage(connect) -> Pymodbus:
    """A connection that is logged in."""
    client = connect()
    client.log_in()
    return client
