import os
import pathlib
import subprocess

import numpy as np
import pytest

import lapservo

SOURCE = pathlib.Path(__file__).resolve().parents[2]
Q = np.array([0.05, 1.57, 0.064, 1.2])


def pytest_configure(config):
    config.addinivalue_line("markers", "wire: loops through a robot's wire in real time")


@pytest.fixture(scope="session")
def sample(tmp_path_factory):
    """The tutorial's recordings."""
    folder = tmp_path_factory.mktemp("recorded") / "sample"
    subprocess.run([os.environ["LAPSERVO_TOOL"], "sample", folder], check=True, capture_output=True)
    return folder


@pytest.fixture(scope="session")
def rig():
    return lapservo.Rig.load(SOURCE / "configs" / "paper.yaml")


@pytest.fixture(scope="session")
def image(rig):
    return lapservo.Renderer(rig).render(Q, seed=3)
