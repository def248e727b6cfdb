"""Same seed, same bytes; and what the ground station must not be able to know changes none of them."""

import os
import subprocess

import pytest
from flights import GCS, digest, messages, recorded, scratch, sent_by

from gcs.ratings import schedule
from scenarios import load

EMERGENCY = load("emergency")
AVERAGE = 'control.rule="average"'


@pytest.fixture(scope="module")
def two_processes():
    """The recordings of one flight in two processes with different hash seeds, folders, and languages."""
    paths = []
    for hash_seed, language in (("0", "C"), ("4242", "C.UTF-8")):
        folder = scratch()
        environment = os.environ | {"PYTHONHASHSEED": hash_seed, "LC_ALL": language}
        command = [GCS, "run", "emergency", "--seed", "1", "--out", folder]
        subprocess.run(command, env=environment, cwd=folder, check=True, capture_output=True)
        paths.append(folder / "run.mcap")
    return paths


def test_the_flight_has_noise_and_gusts():
    assert EMERGENCY.noise.velocity_m_s > 0
    assert EMERGENCY.noise.gust_m_s > 0


def test_the_same_seed_gives_the_same_topics_times_and_payloads_in_any_process(two_processes):
    one, other = two_processes
    assert digest(one) == digest(other)
    assert messages(one) == messages(other)


def test_this_process_flies_the_same_too(two_processes):
    assert digest(two_processes[0]) == digest(recorded("emergency").path)


def test_another_seed_gives_other_bytes():
    assert digest(recorded("emergency").path) != digest(recorded("emergency", seed=2).path)


def test_the_averaged_update_sends_the_same_bytes_whether_or_not_the_ground_station_knows_the_fault():
    """Only the vehicles know that one of them drags."""
    healthy = load("emergency", overrides=[AVERAGE]).without_faults()
    assert sent_by(healthy, world=EMERGENCY) == recorded("emergency", AVERAGE).link.sent


def test_trust_r_that_trusts_everybody_sends_what_it_would_send_if_it_knew_of_no_fault():
    """Trust that comes from people does not know the fault either: only whom they rate."""
    trusting = ("trust.source=ratings", "trust.faulty_rating=5", "trust.others_rating=5")
    known = load("emergency", overrides=trusting)
    assert sent_by(known, world=EMERGENCY) == sent_by(known.without_faults(), world=EMERGENCY)


def test_a_fault_does_change_what_the_vehicles_do():
    healthy = load("emergency", overrides=[AVERAGE]).without_faults()
    assert sent_by(healthy, world=healthy) != recorded("emergency", AVERAGE).link.sent


# --- trust from behaviour and from people: the fault is known to the vehicles only

WRONG = {
    "a motor": (),
    "a GPS": ('fault=[{vehicle=5, kind="gps_drift", onset_s=5}]',),
    "the motor of a leader, who is left behind": ("fault.0.vehicle=1", 'trust.beyond_repair="hold"'),
}
SOURCES = [("auto", "a motor"), ("auto", "a GPS"), *(("fused", wrong) for wrong in WRONG)]


@pytest.mark.parametrize(("source", "wrong"), SOURCES)
def test_behaviour_and_people_make_the_same_bytes_whether_or_not_the_ground_station_knows_the_fault(source, wrong):
    chosen = (*WRONG[wrong], f'trust.source="{source}"')
    world = load("emergency", overrides=chosen)
    ratings = schedule("study", world, seed=1) if source == "fused" else None
    told = recorded("emergency", *chosen, ratings=ratings)
    assert told.summary.detected.keys() == {str(world.fault[0].vehicle)}
    assert sent_by(world.without_faults(), world=world, ratings=ratings) == told.link.sent


@pytest.mark.parametrize("wrong", ["a motor", "a GPS"])
def test_truth_does_know_the_fault_and_sends_other_bytes(wrong):
    """The test above would notice."""
    world = load("emergency", overrides=WRONG[wrong])
    assert sent_by(world.without_faults(), world=world) != recorded("emergency", *WRONG[wrong]).link.sent


def test_what_people_say_does_change_what_is_sent():
    world = load("emergency", overrides=['trust.source="fused"'])
    ratings = schedule("adversarial", world, seed=1)
    said = recorded("emergency", 'trust.source="fused"', ratings=ratings).link.sent
    assert said != recorded("emergency", 'trust.source="auto"').link.sent
