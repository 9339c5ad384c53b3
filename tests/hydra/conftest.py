# SPDX-License-Identifier: Apache-2.0
"""Fixtures: one long-lived rendering process per front end of Hydra, replaced when a test kills it. A missing host is a
failure, never a skip."""

from __future__ import annotations

import os
import pathlib

import pytest
from pxr import Usd

from host import Host

MODES = {"legacy": False, "scene_index": True}
# The front end that the host takes by default, and `usdrecord` with it.
DEFAULT = "scene_index" if Usd.GetVersion() >= (0, 26, 3) else "legacy"


def pytest_configure(config):
    config.addinivalue_line("markers", "both_front_ends: runs once per front end of Hydra (all do with `--full`)")


def pytest_generate_tests(metafunc):
    """A test that asks for `host` runs in the default front end, or in both where it is marked. That a scene means the
    same in both is asked by test_bit_identity.py and test_regression_cases.py."""
    if "host" in metafunc.fixturenames:
        asks_both = metafunc.definition.get_closest_marker("both_front_ends") or os.environ.get("OOCPT_TEST_FULL")
        metafunc.parametrize("host", list(MODES) if asks_both else [DEFAULT], indirect=True)


class Pool:
    """The rendering processes of a test session, by front end."""

    def __init__(self, folder: pathlib.Path) -> None:
        self._folder, self._hosts = folder, {}

    def get(self, mode: str) -> Host:
        host = self._hosts.get(mode)
        if host is None or not host.alive:
            host = self._hosts[mode] = Host(self._folder, MODES[mode])
        return host

    def close(self) -> None:
        for host in self._hosts.values():
            host.close()


@pytest.fixture(scope="session")
def pool(tmp_path_factory):
    pool = Pool(tmp_path_factory.mktemp("pictures"))
    yield pool
    pool.close()


@pytest.fixture
def host(request, pool) -> Host:
    """The process of one front end, which `pytest_generate_tests` chooses."""
    return pool.get(request.param)


@pytest.fixture
def fresh_host(tmp_path):
    """Makes processes of one's own, with other environment variables; they are closed and their exit status checked."""
    made: list[Host] = []

    def make(scene_index: bool = False, **environment: str) -> Host:
        made.append(Host(tmp_path, scene_index, environment))
        return made[-1]

    yield make
    for host in made:
        host.close()
