"""Two pods with one number, each hearing every frame of the other: exactly one of them flies."""

import pytest
from bench import Bench

from drivers.can.pod.messages import ConfigKey, ConfigRequest, Identity, Kind
from sim_bus.buses.pod_core import NODE_NONE

NONE, DUPLICATE, NO_NODE = 0, 1, 3
LOW, MIDDLE, HIGH = bytes([1] * 12), bytes([5] * 12), bytes([9] * 12)
BOTH_ORDERS = pytest.mark.parametrize(
    ("one", "other"), [(HIGH, LOW), (LOW, HIGH)], ids=["high-low", "low-high"]
)


def joined(pods: list[Bench], duration_s: float) -> None:
    """Run the pods on one bus: each hears what the others sent in the millisecond before."""
    seen = [len(pod.board.sent) for pod in pods]
    for _ in range(round(duration_s * 1000)):
        for pod in pods:
            pod.run(0.001)
        for index, speaker in enumerate(pods):
            said, seen[index] = speaker.board.sent[seen[index] :], len(speaker.board.sent)
            for pod in pods:
                for _, frame_id, data in said if pod is not speaker else ():
                    assert pod.core.receive(frame_id, data, pod.board.now_us())


def gyro_frames(pods: list[Bench], duration_s: float = 1.0) -> list[int]:
    """Gyro frames of each pod in the next ``duration_s``."""
    before = [len(pod.messages(Kind.GYRO)) for pod in pods]
    joined(pods, duration_s)
    return [len(p.messages(Kind.GYRO)) - n for p, n in zip(pods, before, strict=True)]


@BOTH_ORDERS
def test_newcomer_is_silent_and_the_running_pod_flies_on(one, other) -> None:
    first = Bench(uid=one)
    first.run(5.0)
    second = Bench(uid=other)
    joined([first, second], 12.0)  # one more round of announcements
    assert (first.core.refusal, second.core.refusal) == (NONE, DUPLICATE)
    assert gyro_frames([first, second]) == [100, 0]


@BOTH_ORDERS
def test_of_two_that_boot_at_once_one_flies(one, other) -> None:
    pods = [Bench(uid=one), Bench(uid=other)]
    joined(pods, 12.0)
    assert sorted(pod.core.refusal for pod in pods) == [NONE, DUPLICATE]
    assert sorted(gyro_frames(pods)) == [0, 100]


def test_of_two_that_announce_in_the_same_instant_the_lower_id_flies() -> None:
    # The spread depends on a hash of the id; equal bytes in another place give the same.
    ids = [bytes([1, *[0] * 7, 2, *[0] * 3]), bytes([2, *[0] * 7, 1, *[0] * 3])]
    for one, other in (ids, ids[::-1]):
        pods = [Bench(uid=one), Bench(uid=other)]
        joined(pods, 12.0)
        firsts = [next(t for t, i, _ in pod.board.sent if i & ~15 == 0x300) for pod in pods]
        assert firsts[0] == firsts[1]
        assert [p.core.refusal for p in pods] == (
            [NONE, DUPLICATE] if one < other else [DUPLICATE, NONE]
        )


@BOTH_ORDERS
def test_of_two_buses_joined_in_flight_the_lower_id_flies(one, other) -> None:
    pods = [Bench(uid=one), Bench(uid=other)]
    for pod in pods:
        pod.run(3.0)
    joined(pods, 3.0)
    assert [pod.core.refusal for pod in pods] == [DUPLICATE * (u == HIGH) for u in (one, other)]
    assert sorted(gyro_frames(pods)) == [0, 100]


@BOTH_ORDERS
@pytest.mark.parametrize("genuine_is_first", [True, False])
def test_pod_without_a_number_does_not_disturb_node_15(one, other, genuine_is_first) -> None:
    pods = [Bench(node=15, uid=one), Bench(node=NODE_NONE, uid=other)]
    pods[0 if genuine_is_first else 1].run(5.0)
    joined(pods, 12.0)
    assert [pod.core.refusal for pod in pods] == [NONE, NO_NODE]
    assert gyro_frames(pods) == [100, 0]


def test_running_pod_comes_back_after_a_brown_out_beside_the_silent_one() -> None:
    first, second = Bench(uid=HIGH), Bench(uid=LOW)
    first.run(5.0)
    joined([first, second], 3.0)
    first.core.restart(3, reset_cause=5)
    joined([first, second], 3.0)
    assert (first.core.refusal, second.core.refusal) == (NONE, DUPLICATE)
    assert gyro_frames([first, second]) == [100, 0]


def test_id_parts_of_a_silent_pod_are_not_taken_for_those_of_a_third() -> None:
    pod = Bench(uid=MIDDLE)
    pod.run(2.0)
    refused, running = bytes([1, 1, 0, 0, 1, DUPLICATE]), bytes([1, 1, 0, 0, 1, NONE])
    for part, payload in ((0, refused), (0, running), (1, LOW[:6]), (1, HIGH[:6])):
        pod.hear(Identity(pod.node, part, payload))
    pod.run(0.1)
    assert pod.core.refusal == NONE
    pod.run(1.0)
    for part, payload in ((1, LOW[:6]), (2, LOW[6:])):  # nothing says that this one runs
        pod.hear(Identity(pod.node, part, payload))
    pod.run(0.1)
    assert pod.core.refusal == NONE


def test_silent_pod_leaves_requests_to_the_one_that_flies() -> None:
    first, second = Bench(uid=HIGH), Bench(uid=LOW)
    first.run(5.0)
    joined([first, second], 3.0)
    for pod in (first, second):
        pod.hear(ConfigRequest(3, 1, ConfigKey.NODE, 4))
    joined([first, second], 0.1)
    assert (first.board.stored_node, second.board.stored_node) == (4, None)
