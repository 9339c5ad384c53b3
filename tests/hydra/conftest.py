# SPDX-License-Identifier: Apache-2.0
"""Fixtures: one long-lived rendering process per front end of Hydra, replaced when a test kills it. A missing host is a
failure, never a skip."""

from __future__ import annotations

import pathlib

import pytest

from host import Host

MODES = {"legacy": False, "scene_index": True}


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


@pytest.fixture(params=list(MODES))
def host(request, pool) -> Host:
    """The process of one front end; a test that asks for it runs once per front end."""
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
