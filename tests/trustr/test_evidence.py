"""What the swarm's own behaviour says of each robot, in synthetic flights whose faults are known."""

from dataclasses import replace
from itertools import pairwise
from math import exp

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gcs.beliefs import watch
from gcs.control import settings
from scenarios import load
from scenarios.degradation import degrade
from trustr.evidence import (
    AGAINST,
    ENOUGH_TO_SHARE,
    FOR,
    HIGHEST,
    INNOCENT,
    LOWEST,
    PRIOR,
    TICK_S,
    WILDEST,
    Evidence,
    forgiven,
    neighbourhood,
    shared,
    spreads,
    trust_of,
    weigh,
)
from trustr.identification import Sample
from trustr.network import neighbours
from trustr.response import followed

TRANSIT = load("transit")
WATCH = watch(TRANSIT, settings(TRANSIT))
CRUISE, RANGE, DT = 1.5, 28.0, WATCH.dt
BEFORE_S = 4.0
"""Of set-points before the mission, watched and not judged."""
ONSET_S = 12.0


def commands(*, seconds, seed=0, count=6, dt=DT, straight=False):
    """Cruise whose heading changes every 10 s; each robot is told its own besides, as feedback and separation do."""
    rng, kept, ticks = np.random.default_rng(seed), exp(-dt / 1.0), round(seconds / dt)
    heading = rng.uniform(-np.pi, np.pi, ticks // round(10 / dt) + 1).repeat(round(10 / dt))[:ticks]
    if straight:
        heading[:] = heading[0]
    own = np.zeros((ticks, count, 2))
    for before, after in pairwise(range(ticks)):
        own[after] = kept * own[before] + 0.1 * (1 - kept**2) ** 0.5 * rng.standard_normal((count, 2))
    return CRUISE * np.stack([np.cos(heading), np.sin(heading)], axis=-1)[:, None] + own


def flight(commanded, *, obeyed=None, noise=0.0, seed=0, dt=DT):
    """Robots that follow what they obey, a formation at first; noise: m/s and m, of both telemetries, (T,) or one."""
    rng = np.random.default_rng(1000 + seed)
    velocity = followed(WATCH.response, commanded[0], commanded if obeyed is None else obeyed, dt=dt)
    steps = 0.5 * dt * (velocity[1:] + velocity[:-1])
    place = np.array([(3.0 * (row // 3), 3.0 * (row % 3)) for row in range(commanded.shape[1])])
    position = place + np.concatenate([np.zeros_like(velocity[:1]), np.cumsum(steps, axis=0)])
    spread = np.broadcast_to(noise, len(commanded))[:, None, None]
    blurred = (true + spread * rng.standard_normal(true.shape) for true in (velocity, position))
    return Sample(commanded, *blurred)


def degraded(commanded, *rows, speed=0.4, offset=0.47, onset_s=ONSET_S, end_s=None, dt=DT):
    """What robots with the paper's fault obey instead."""
    obeyed = commanded.copy()
    for tick in range(round(onset_s / dt), len(commanded) if end_s is None else round(end_s / dt)):
        for row in rows:
            obeyed[tick, row] = degrade(
                tuple(commanded[tick, row]), cruise=CRUISE, max_speed_fraction=speed, offset_fraction=offset
            )
    return obeyed


def judged(sample, **how):
    """(T, N) log odds of being faulty, tick by tick."""
    return np.array([evidence.log_odds for evidence in gathered(sample, **how)])


def gathered(sample, *, told=None, dt=DT, range_m=RANGE):
    """The evidence, tick by tick."""
    chosen, everybody = replace(WATCH, dt=dt), np.ones(sample.velocity_ne.shape[1], bool)
    evidence = Evidence.start(
        chosen,
        commanded_ne=sample.commanded_ne[0],
        position_ne=sample.position_ne[0],
        velocity_ne=sample.velocity_ne[0],
    )
    all_of_it = [evidence]
    for tick in range(1, len(sample.velocity_ne)):
        heard = everybody if told is None else told[tick]
        position = sample.position_ne[tick]
        graph = neighbours(position, heard, range_m=range_m) if tick * dt >= BEFORE_S else None
        evidence = weigh(
            evidence,
            chosen,
            commanded_ne=sample.commanded_ne[tick - 1],
            position_ne=position,
            velocity_ne=sample.velocity_ne[tick],
            told=heard,
            graph=graph,
        )
        all_of_it.append(evidence)
    return all_of_it


def found_after_s(odds, row, *, onset_s=ONSET_S, dt=DT):
    """How long a robot's fault lasted [s] until its trust was below 0.5; infinite, if it never was."""
    below = np.flatnonzero(odds[round(onset_s / dt) :, row] > 0.0)
    return below[0] * dt if below.size else np.inf


def changed(sample, *, velocity=None, position=None):
    """The same flight with telemetry (T, N, 2) bent in place by these."""
    bent = {"velocity_ne": sample.velocity_ne.copy(), "position_ne": sample.position_ne.copy()}
    for name, change in (("velocity_ne", velocity), ("position_ne", position)):
        if change is not None:
            change(bent[name])
    return replace(sample, **bent)


def nobody_is_accused(odds):
    return bool((odds <= 0.0).all())


# --- healthy swarms


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.25])
@pytest.mark.parametrize("seed", range(2))
def test_a_healthy_swarm_is_trusted_whatever_the_noise(noise, seed):
    assert nobody_is_accused(judged(flight(commands(seconds=60, seed=seed), noise=noise, seed=seed)))


@pytest.mark.parametrize("seed", range(3))
def test_noise_that_sets_in_suddenly_accuses_nobody(seed):
    told = commands(seconds=25, seed=seed)
    noise = np.where(np.arange(len(told)) * DT < 15, 0.0, 0.25)
    assert nobody_is_accused(judged(flight(told, noise=noise, seed=seed)))


@pytest.mark.parametrize("count", [1, 2, 3, 12])
def test_swarms_of_any_size_are_trusted(count):
    assert nobody_is_accused(judged(flight(commands(seconds=30, count=count, seed=count), noise=0.05, seed=count)))


def test_robots_out_of_each_others_range_are_trusted():
    odds = judged(flight(commands(seconds=30), noise=0.05), range_m=0.5)
    assert nobody_is_accused(odds)


def in_wind(sample, *, onset_s=ONSET_S, drift=(0.6, -0.4)):
    """Air that begins to move: all drift alike, none of them obeys."""
    begins = round(onset_s / DT)

    def blow(velocity):
        velocity[begins:] += drift

    def carry(position):
        position[begins:] += np.arange(1, len(position) - begins + 1)[:, None, None] * DT * np.array(drift)

    return changed(sample, velocity=blow, position=carry)


@pytest.mark.parametrize("drift", [(0.6, -0.4), (0.0, 2.5)])
def test_what_all_share_is_nobodys_fault(drift):
    assert nobody_is_accused(judged(in_wind(flight(commands(seconds=30), noise=0.05), drift=drift)))


def test_in_wind_that_strikes_all_a_fault_is_found_as_soon_as_in_calm_air():
    told = commands(seconds=20, straight=True)
    calm = flight(told, obeyed=degraded(told, 4), noise=0.05)
    odds = judged(in_wind(calm, onset_s=8.0))
    assert found_after_s(odds, 4) == pytest.approx(found_after_s(judged(calm), 4), abs=0.3)
    assert nobody_is_accused(np.delete(odds, 4, axis=1))


def test_without_a_graph_robots_are_watched_and_not_judged():
    told = commands(seconds=BEFORE_S - DT)
    assert (judged(flight(told, obeyed=degraded(told, 4, onset_s=0.0))) == PRIOR).all()


# --- what healthy robots' residuals come to


def noisy(*, velocity_m_s=0.0, position_m=0.0, loud=(), seed=0):
    """Perfect robots whose telemetry is noisy, that of the loud ones five times as much."""
    sample, rng = flight(commands(seconds=40, straight=True)), np.random.default_rng(seed)
    louder = np.where(np.isin(np.arange(6), loud), 5.0, 1.0)[:, None]
    return replace(
        sample,
        velocity_ne=sample.velocity_ne + velocity_m_s * louder * rng.standard_normal(sample.velocity_ne.shape),
        position_ne=sample.position_ne + position_m * louder * rng.standard_normal(sample.position_ne.shape),
    )


def mean_of(values):
    """Over the last thirty seconds of ticks, and all robots and axes."""
    return float(np.mean(list(values)[-300:]))


def ordered(rank, count):
    """The mean of the rank-th smallest of so many squared lengths of standard normal vectors in the plane."""
    return 2.0 * sum(1.0 / (count - below) for below in range(rank))


@pytest.mark.parametrize("loud", [(), (1,), (0, 5)])
def test_noise_of_telemetry_is_measured_and_a_loud_third_of_the_swarm_adds_half_of_it_at_most(loud):
    """The median of six is the mean of the third and fourth; the quiet ones are the smallest.

    What rises faster than it falls settles above the mean, by an eighth here.
    """
    quiet = 6 - len(loud)
    more = (0.5 * (ordered(3, quiet) + ordered(4, quiet)) / (2.0 * np.log(2.0))) ** 0.5
    ticks = gathered(noisy(velocity_m_s=0.2, position_m=0.1, loud=loud))
    assert mean_of(tick.velocity_noise for tick in ticks) ** 0.5 == pytest.approx(1.13 * more * 0.2, rel=0.1)
    assert mean_of(tick.place_noise for tick in ticks) ** 0.5 == pytest.approx(1.13 * more * 0.1, rel=0.15)
    assert more < 1.6


@pytest.mark.parametrize(("velocity_m_s", "position_m"), [(0.25, 0.01), (0.01, 0.25), (0.1, 0.1)])
def test_what_noise_makes_of_the_residuals_is_allowed_for_and_not_much_more(velocity_m_s, position_m):
    ticks = gathered(noisy(velocity_m_s=velocity_m_s, position_m=position_m))
    quiet = replace(WATCH, tolerance=0.0, place_tolerance=0.0)
    allowed = [spreads(tick, quiet) for tick in ticks]
    response, place = (mean_of(variance[k] for variance in allowed) for k in (0, 1))
    assert 0.5 * response <= mean_of(tick.residual_ne**2 for tick in ticks) <= response
    assert 0.5 * place <= mean_of(tick.inconsistency_ne**2 for tick in ticks) <= place


@pytest.mark.parametrize("faulty", [(), (4,), (0, 1, 2)])
def test_gusts_are_measured_as_the_swarms_unrest_whatever_half_the_swarm_does(faulty):
    """Each robot's own, first-order Gauss–Markov; smoothing takes a part of it, which the residuals show.

    The third of six is taken: among three healthy ones that is the largest.
    """
    told, rng, kept = commands(seconds=60), np.random.default_rng(3), exp(-DT / 2.0)
    sample = flight(told, obeyed=degraded(told, *faulty, onset_s=0.0))
    gust = 0.2 * rng.standard_normal(told.shape)
    for before, after in pairwise(range(len(gust))):
        gust[after] = kept * gust[before] + (1 - kept**2) ** 0.5 * gust[after]
    ticks = gathered(replace(sample, velocity_ne=sample.velocity_ne + gust))
    healthy = np.setdiff1d(np.arange(6), faulty)
    shown = mean_of(tick.residual_ne[healthy] ** 2 for tick in ticks)
    more = ordered(3, len(healthy)) / ordered(3, 6)
    assert mean_of(tick.unrest for tick in ticks) == pytest.approx(more * shown, rel=0.3)
    assert mean_of(spreads(tick, WATCH)[0] for tick in ticks) > WATCH.tolerance**2 + 0.7 * shown


# --- faults


@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize(("speed", "offset"), [(0.4, 0.47), (0.7, 0.47)])
def test_the_papers_fault_is_found_within_two_and_a_half_seconds(speed, offset, noise):
    told = commands(seconds=16, straight=True)
    odds = judged(flight(told, obeyed=degraded(told, 4, speed=speed, offset=offset), noise=noise))
    assert found_after_s(odds, 4) <= 2.5
    assert nobody_is_accused(np.delete(odds, 4, axis=1))


@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize("speed", [0.7, 0.9])
def test_a_small_fault_is_found_within_eight_seconds(speed, noise):
    told = commands(seconds=21, straight=True)
    odds = judged(flight(told, obeyed=degraded(told, 4, speed=speed, offset=0.2), noise=noise))
    assert found_after_s(odds, 4) <= 8.0
    assert nobody_is_accused(np.delete(odds, 4, axis=1))


def test_in_noise_as_large_as_a_small_fault_the_papers_fault_is_still_found():
    told = commands(seconds=18, straight=True)
    odds = judged(flight(told, obeyed=degraded(told, 4), noise=0.25))
    assert found_after_s(odds, 4) <= 4.0


def test_trust_is_regained_as_fast_as_the_constants_let_it():
    """From the highest log odds down to even, FOR a tick, once the robot flies as it is told and the filters know."""
    told, end_s = commands(seconds=50, straight=True), 25.0
    odds = judged(flight(told, obeyed=degraded(told, 4, end_s=end_s), noise=0.05))
    back_s = np.flatnonzero(odds[:, 4] > 0.0)[-1] * DT - end_s
    quickest = HIGHEST / FOR * TICK_S
    assert odds[round(end_s / DT), 4] == HIGHEST
    assert quickest <= back_s <= quickest + 3.0
    assert odds[-1, 4] == pytest.approx(LOWEST)


@pytest.mark.parametrize("rows", [(1, 4), (0, 1, 2)])
@pytest.mark.parametrize("speed", [0.4, 0.7])
def test_up_to_half_the_swarm_failing_alike_is_found_and_nobody_else_is_accused(rows, speed):
    told = commands(seconds=25)
    odds = judged(flight(told, obeyed=degraded(told, *rows, speed=speed), noise=0.05))
    assert max(found_after_s(odds, row) for row in rows) <= 2.5
    assert (odds[round((ONSET_S + 2.5) / DT) :, rows] > 0.0).all()  # and stays found
    assert nobody_is_accused(np.delete(odds, rows, axis=1))


@pytest.mark.parametrize("count", [1, 2, 3])
def test_in_the_smallest_swarms_the_faulty_one_is_found_and_no_other(count):
    told = commands(seconds=20, count=count, straight=True)
    odds = judged(flight(told, obeyed=degraded(told, 0), noise=0.05))
    assert found_after_s(odds, 0) <= 2.5
    assert nobody_is_accused(odds[:, 1:])


@pytest.mark.parametrize("dt", [0.05, 0.2])
@pytest.mark.parametrize(("speed", "offset"), [(0.4, 0.47), (0.9, 0.2)])
def test_a_tick_of_another_length_finds_a_fault_about_as_soon(dt, speed, offset):
    times = []
    for length in (DT, dt):
        told = commands(seconds=20, straight=True, dt=length, seed=2)
        obeyed = degraded(told, 4, speed=speed, offset=offset, dt=length)
        odds = judged(flight(told, obeyed=obeyed, noise=0.03, dt=length), dt=length)
        assert nobody_is_accused(np.delete(odds, 4, axis=1))
        times.append(found_after_s(odds, 4, dt=length))
    assert times[1] == pytest.approx(times[0], abs=0.5)


# --- lies, and telemetry that fails


FROM = round(ONSET_S / DT)


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_frozen_position_under_a_velocity_that_moves_is_found(noise):
    def freeze(position):
        position[FROM:, 2] = position[FROM, 2]

    odds = judged(changed(flight(commands(seconds=17, straight=True), noise=noise), position=freeze))
    assert found_after_s(odds, 2) <= 2.5
    assert nobody_is_accused(np.delete(odds, 2, axis=1))


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_position_that_drifts_is_found(noise):
    def drift(position):
        position[FROM:, 2, 1] += 0.5 * DT * np.arange(len(position) - FROM)

    odds = judged(changed(flight(commands(seconds=18), noise=noise), position=drift))
    assert found_after_s(odds, 2) <= 4.0
    assert nobody_is_accused(np.delete(odds, 2, axis=1))


def test_a_robot_that_does_what_it_is_told_and_not_what_its_neighbours_do_is_found():
    """Its commands, its velocity and its position all agree; only those beside it fly elsewhere."""
    told = commands(seconds=18, straight=True)
    told[FROM:, 4] *= -1
    odds = judged(flight(told, noise=0.05))
    assert found_after_s(odds, 4) <= 4.0
    assert nobody_is_accused(np.delete(odds, 4, axis=1))


@pytest.mark.parametrize("size", [10.0, -1000.0, 3e38])
@pytest.mark.parametrize("what", ["velocity", "position"])
def test_a_single_wild_message_costs_nobody_trust(what, size):
    def spoil(telemetry):
        telemetry[FROM, 2, 0] += size

    assert nobody_is_accused(judged(changed(flight(commands(seconds=18), noise=0.05), **{what: spoil})))


# --- silence


def silent(sample, row, *, ticks):
    """(sample, told) of a robot that says nothing for so long; meanwhile it stands at zero, as unheard robots do."""
    told = np.ones(sample.velocity_ne.shape[:2], bool)
    told[FROM : FROM + ticks, row] = False

    def blank(telemetry):
        telemetry[~told] = 0.0

    return changed(sample, velocity=blank, position=blank), told


@pytest.mark.parametrize("ticks", [1, 3, 4, 9, 10, 11, 50])
def test_who_falls_silent_and_comes_back_is_not_accused(ticks):
    sample, told = silent(flight(commands(seconds=22), noise=0.05), 2, ticks=ticks)
    odds = judged(sample, told=told)
    assert nobody_is_accused(odds)
    assert (odds[~told[:, 2], 2] == odds[FROM - 1, 2]).all()


@pytest.mark.parametrize("straight", [True, False])
def test_who_stood_still_through_a_long_silence_is_not_accused_for_it(straight):
    """No command reached it."""
    commanded = commands(seconds=22, straight=straight)
    obeyed = commanded.copy()
    obeyed[FROM : FROM + 40, 2] = 0.0
    sample, told = silent(flight(commanded, obeyed=obeyed, noise=0.05), 2, ticks=40)
    assert nobody_is_accused(judged(sample, told=told))


def test_who_is_forgiven_is_as_one_of_whom_nothing_is_known_and_nobody_else_is():
    evidence = gathered(flight(degraded(commands(seconds=17), 2, 3)))[-1]
    one = forgiven(evidence, np.arange(6) == 2)
    assert evidence.log_odds[2] > PRIOR == one.log_odds[2]
    for field in ("residual_ne", "inconsistency_ne", "disagreement_ne"):
        assert not getattr(one, field)[2].any()
        others = np.arange(6) != 2
        assert (getattr(one, field)[others] == getattr(evidence, field)[others]).all()


def test_who_comes_back_with_a_fault_is_found():
    told = commands(seconds=22, straight=True)
    sample, heard = silent(flight(told, obeyed=degraded(told, 2, onset_s=ONSET_S + 1), noise=0.05), 2, ticks=20)
    odds = judged(sample, told=heard)
    assert found_after_s(odds, 2, onset_s=ONSET_S + 2) <= 2.5
    assert nobody_is_accused(np.delete(odds, 2, axis=1))


@pytest.mark.parametrize("lost", [0.3, 0.7])
def test_telemetry_that_is_lost_now_and_then_accuses_nobody(lost):
    """What was heard last stands meanwhile."""
    sample = flight(commands(seconds=40), noise=0.05)
    told = np.random.default_rng(5).random(sample.velocity_ne.shape[:2]) >= lost

    def stand(telemetry):
        for before, after in pairwise(range(len(telemetry))):
            telemetry[after] = np.where(told[after][:, None], telemetry[after], telemetry[before])

    assert nobody_is_accused(judged(changed(sample, velocity=stand, position=stand), told=told))


def test_a_position_that_drifts_is_found_where_every_other_message_is_lost():
    def drift(position):
        position[FROM:, 2, 1] += 0.5 * DT * np.arange(len(position) - FROM)

    sample = changed(flight(commands(seconds=22), noise=0.05), position=drift)
    told = np.ones(sample.velocity_ne.shape[:2], bool)
    told[1::2] = False
    odds = judged(sample, told=told)
    assert found_after_s(odds, 2) <= 8.0
    assert nobody_is_accused(np.delete(odds, 2, axis=1))


def test_a_swarm_of_which_nothing_is_heard_rests():
    sample = flight(commands(seconds=10))
    told = np.zeros(sample.velocity_ne.shape[:2], bool)
    assert (judged(sample, told=told) == PRIOR).all()


# --- any input


def after(sample, told):
    """The evidence after every tick of a sample, judged from the first."""
    evidence = Evidence.start(
        WATCH,
        commanded_ne=sample.commanded_ne[0],
        position_ne=sample.position_ne[0],
        velocity_ne=sample.velocity_ne[0],
    )
    for tick in range(1, len(told)):
        evidence = weigh(
            evidence,
            WATCH,
            commanded_ne=sample.commanded_ne[tick - 1],
            position_ne=sample.position_ne[tick],
            velocity_ne=sample.velocity_ne[tick],
            told=told[tick],
            graph=neighbours(sample.position_ne[tick], told[tick], range_m=RANGE),
        )
    return evidence


@st.composite
def wild_flights(draw, elements):
    count, ticks = draw(st.integers(1, 5)), draw(st.integers(2, 8))
    said = [draw(arrays(float, (ticks, count, 2), elements=elements)) for _ in range(3)]
    return Sample(*said), draw(arrays(bool, (ticks, count)))


float32s = st.floats(width=32, allow_nan=False, allow_infinity=False) | st.floats(-3, 3)


@given(wild_flights(float32s))
def test_whatever_is_told_evidence_is_finite_and_within_its_bounds(flown):
    evidence = after(*flown)
    for name in Evidence.__slots__:
        assert np.isfinite(np.asarray(getattr(evidence, name), float)).all(), name
    assert (evidence.log_odds >= LOWEST).all()
    assert (evidence.log_odds <= HIGHEST).all()
    assert ((trust_of(evidence.log_odds) >= 0) & (trust_of(evidence.log_odds) <= 1)).all()
    for residual in (evidence.raw_ne, evidence.residual_ne, evidence.strayed_ne, evidence.inconsistency_ne):
        assert np.hypot(*residual.T).max() <= 3 * WILDEST


@given(wild_flights(st.floats(-3, 3)), st.randoms(use_true_random=False))
def test_robots_that_change_names_take_their_evidence_along(flown, random):
    sample, told = flown
    order = list(range(told.shape[1]))
    random.shuffle(order)
    renamed = Sample(*(said[:, order] for said in (sample.commanded_ne, sample.velocity_ne, sample.position_ne)))
    one, other = after(sample, told), after(renamed, told[:, order])
    assert other.log_odds == pytest.approx(one.log_odds[order], abs=1e-9)
    assert other.disagreement_ne == pytest.approx(one.disagreement_ne[order], abs=1e-9)
    assert other.predicted_ne == pytest.approx(one.predicted_ne[order], abs=1e-9)


@given(wild_flights(st.floats(-3, 3)), st.sampled_from([0.0, -1e9, np.nan]))
def test_what_is_said_of_a_robot_that_is_not_told_does_not_matter(flown, value):
    sample, told = flown
    told[0] = True
    velocity, position = sample.velocity_ne.copy(), sample.position_ne.copy()
    velocity[~told], position[~told] = value, value
    one, other = after(sample, told), after(replace(sample, velocity_ne=velocity, position_ne=position), told)
    assert (one.log_odds == other.log_odds).all()
    assert (one.predicted_ne == other.predicted_ne).all()


@given(wild_flights(st.floats(-3, 3)))
def test_evidence_of_who_is_not_told_rests(flown):
    sample, told = flown
    told[1:, 0] = False
    assert after(sample, told).log_odds[0] == PRIOR


@given(wild_flights(float32s))
def test_what_was_known_stays_as_it_was(flown):
    sample, told = flown
    copies = [said.copy() for said in (sample.commanded_ne, sample.velocity_ne, sample.position_ne)]
    after(sample, told)
    for said, copy in zip((sample.commanded_ne, sample.velocity_ne, sample.position_ne), copies, strict=True):
        assert (said == copy).all()


# --- what is shared


residuals = st.integers(1, 9).flatmap(lambda n: arrays(float, (n, 2), elements=st.floats(-3, 3)))


def closest_to_zero_of_the_middle(values):
    """Of a list, with a third (of one less) left aside at either end; 0 where the rest differ in sign."""
    aside = (len(values) - 1) // 3
    kept = sorted(values)[aside : len(values) - aside]
    return 0.0 if kept[0] <= 0.0 <= kept[-1] else min(kept, key=abs)


@given(residuals, st.data())
def test_shared_is_its_definition(raw, data):
    told = data.draw(arrays(bool, len(raw)))
    expected = [closest_to_zero_of_the_middle(list(raw[told, axis])) if told.any() else 0.0 for axis in (0, 1)]
    assert shared(raw, told).tolist() == (expected if told.sum() >= ENOUGH_TO_SHARE else [0.0, 0.0])


@given(st.integers(3, 12), st.data())
def test_as_long_as_more_than_a_third_obey_the_others_cannot_put_their_fault_upon_them(count, data):
    raw = data.draw(arrays(float, (count, 2), elements=st.floats(-3, 3)))
    obeying = (count - 1) // 3 + 1
    raw[data.draw(st.permutations(range(count)))[:obeying]] = 0.0
    assert not shared(raw, np.ones(count, bool)).any()


@given(st.integers(3, 9), st.floats(-3, 3), st.floats(-3, 3))
def test_what_every_robot_shows_is_shared_in_full(count, north, east):
    assert shared(np.tile([north, east], (count, 1)), np.ones(count, bool)).tolist() == [north, east]


# --- the neighbourhood


@given(st.integers(1, 7), st.data())
def test_the_neighbourhood_is_numpys_median_of_the_trusted_others_heard(count, data):
    position = data.draw(arrays(float, (count, 2), elements=st.floats(-30, 30)))
    velocity = data.draw(arrays(float, (count, 2), elements=st.floats(-3, 3)))
    trusted = data.draw(arrays(bool, count))
    graph = neighbours(position, np.ones(count, bool), range_m=RANGE)
    medians = neighbourhood(graph, velocity, trusted)
    for robot in range(count):
        heard = [j for j in graph.sender[graph.receiver == robot] if j != robot and trusted[j]]
        assert medians[robot] == pytest.approx(np.median(velocity[heard or [robot]], axis=0), abs=1e-12)


# --- constants


def test_a_residual_of_so_many_sigma_speaks_neither_for_nor_against():
    still, told = np.zeros((1, 2)), np.array([True])
    graph = neighbours(still, told, range_m=RANGE)
    start = Evidence.start(WATCH, commanded_ne=still, position_ne=still, velocity_ne=still)
    calm = replace(start, velocity_noise=0.0, place_noise=0.0)

    def change(share):
        """Of the log odds in a tick, where a response residual of so much of it is steady, and there is no noise."""
        off = np.array([[share * INNOCENT * WATCH.tolerance, 0.0]])
        steady = replace(calm, raw_ne=off, residual_ne=off)
        return (
            weigh(steady, WATCH, commanded_ne=still, position_ne=off * DT, velocity_ne=off, told=told, graph=graph)
            .log_odds[0]
            .item()
        ) - PRIOR

    assert change(1.0) == pytest.approx(0.0, abs=1e-9)
    assert change(0.9) < 0.0 < change(1.1)
    assert change(0.0) == pytest.approx(-FOR)
    assert change(99.0) == pytest.approx(AGAINST)
