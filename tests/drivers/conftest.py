"""Benches that are closed in the end."""

import pytest

from tests.drivers.wing_bench import Bench, make_bench


@pytest.fixture
def bench():
    made: list[Bench] = []

    def make(*args, **kwargs) -> Bench:
        made.append(make_bench(*args, **kwargs))
        return made[-1]

    yield make
    for one in made:
        one.imus.close()
        for pod in one.pods:
            pod.close()
