"""The live inlet for ratings: bytes in, bytes out, then the same over loopback."""

import os
import socket
import struct
import time
from contextlib import closing, suppress

import orjson
import pytest
from flights import SHORT, Saying, messages, scratch
from hypothesis import given
from hypothesis import strategies as st

from gcs.clients import BUFFER, CLIENTS, LINE, LINES_A_TICK, Conversation
from gcs.events import LAND, Rating
from gcs.inlet import HOST, Inlet
from gcs.lockstep import Lockstep
from gcs.operator import Operator
from gcs.ratings import RatingsError, parse, written
from gcs.replay.verify import decide_again
from gcs.session import flown
from scenarios import load

BAD, GOOD = Rating("op1", 5, 1), Rating("op2", None, 4)


def line(rating):
    return written(rating) + b"\n"


def conversation():
    """With one who rates six vehicles."""
    return Conversation(lambda line: parse(line, count=6, live=True))


def answers(talk):
    """What it has to say, taken off its hands."""
    data = talk.data_to_send()
    talk.sent(len(data))
    return [orjson.loads(answer) for answer in data.splitlines()]


@pytest.fixture
def talk():
    return conversation()


# --- bytes in, bytes out


def test_a_rating_counts_at_the_tick_that_the_answer_names(talk):
    talk.receive(line(BAD))
    assert talk.step(41) == [BAD]
    assert answers(talk) == [{"tick": 41}]
    assert talk.step(42) == []
    assert answers(talk) == []


@given(st.lists(st.sampled_from([BAD, GOOD]), max_size=LINES_A_TICK), st.data())
def test_it_does_not_matter_where_the_bytes_are_cut(ratings, data):
    stream = b"".join(map(line, ratings))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=5)))
    talk, heard = conversation(), []
    for begin, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        talk.receive(stream[begin:end])
        heard += talk.step(7)
        talk.sent(len(talk.data_to_send()))
    assert heard == ratings


@pytest.mark.parametrize(
    ("garbage", "said"),
    [
        (b"\x00\xff\xfe", "not valid JSON"),
        (b"hello", "not valid JSON"),
        (b'{"rater": "op1", "vehicle": 9, "rating": 1}', "vehicle = 9"),
        (b'{"time_s": 3, "rater": "op1", "vehicle": 5, "rating": 1}', "time_s = 3"),
        (b"x" * (LINE + 1), "too long"),
    ],
)
def test_a_line_that_is_no_rating_is_answered_with_why_and_the_next_one_counts(talk, garbage, said):
    talk.receive(garbage + b"\n" + line(BAD))
    assert talk.step(3) == [BAD]
    refusal, tick = answers(talk)
    assert said in refusal["error"]
    assert tick == {"tick": 3}


def test_blank_lines_and_carriage_returns_are_no_matter(talk):
    talk.receive(b"\r\n\n" + written(BAD) + b"\r\n")
    assert talk.step(0) == [BAD]
    assert answers(talk) == [{"tick": 0}]


def test_a_line_without_end_is_refused_once_and_takes_no_memory(talk):
    for _ in range(100):
        talk.receive(b"x" * talk.room)
        assert talk.step(0) == []
        assert talk.room == BUFFER
    assert [list(answer) for answer in answers(talk)] == [["error"]]
    talk.receive(b"x\n" + line(BAD))
    assert talk.step(1) == [BAD]


def test_of_one_client_so_many_lines_count_at_a_tick_and_the_rest_at_the_next(talk):
    talk.receive(line(GOOD) * (LINES_A_TICK + 2))
    assert len(talk.step(0)) == LINES_A_TICK
    assert answers(talk) == [{"tick": 0}] * LINES_A_TICK
    assert len(talk.step(1)) == 2
    assert answers(talk) == [{"tick": 1}] * 2


def test_who_does_not_read_the_answers_is_heard_no_further(talk):
    talk.receive(line(GOOD) * (LINES_A_TICK + 1))
    talk.step(0)
    waiting = talk.data_to_send()
    assert talk.step(1) == []
    assert talk.data_to_send() == waiting
    talk.receive(b"x" * talk.room)
    assert talk.room == 0
    talk.sent(len(waiting))
    assert talk.step(2) == [GOOD]


def test_a_last_line_may_lack_its_end_but_not_a_part_of_itself(talk):
    talk.receive(written(GOOD))
    assert talk.step(0) == []
    talk.end()
    assert talk.step(1) == [GOOD]
    assert not talk.over
    assert answers(talk) == [{"tick": 1}]
    assert talk.over
    cut = conversation()
    cut.receive(written(GOOD)[:-1])
    cut.end()
    assert cut.step(0) == []
    assert "error" in answers(cut)[0]
    assert cut.over


@pytest.mark.parametrize("length", [0, 1100, 3900])
def test_a_web_page_that_posts_a_rating_is_not_heard_however_long_the_path(talk, length):
    talk.receive(b"POST /" + b"a" * length + b" HTTP/1.1\r\nHost: localhost\r\n\r\n" + line(BAD))
    assert talk.step(0) == []
    assert "no web server" in answers(talk)[0]["error"]
    assert talk.over


@given(st.lists(st.binary(max_size=200), max_size=30), st.booleans())
def test_garbage_never_raises_counts_or_grows(chunks, reading):
    talk = conversation()
    for tick, chunk in enumerate(chunks):
        talk.receive(chunk[: talk.room])
        assert talk.step(tick) == []
        assert len(talk.data_to_send()) <= 4 * LINE
        if reading:
            talk.sent(len(talk.data_to_send()))


# --- over loopback


class Ticked:
    """An inlet, and at which tick it is."""

    def __init__(self, inlet):
        self.inlet, self.port, self.tick = inlet, inlet.port, 0

    @property
    def talks(self):
        return [talk for _, talk in self.inlet._lines._clients]

    def until(self, enough, *, within_s=5.0):
        """Tick until what was taken is enough: (tick, rating) of each. Loopback delivers when it likes."""
        taken, deadline = [], time.monotonic() + within_s
        while not enough(taken):
            assert time.monotonic() < deadline, taken
            taken += self.turn()
        return taken

    def turn(self):
        tick, self.tick = self.tick, self.tick + 1
        return [(tick, rating) for rating in self.inlet.take()]


@pytest.fixture
def inlet():
    with Inlet(0, count=6) as unticked:
        yield Ticked(unticked)


def client(inlet):
    return closing(socket.create_connection((HOST, inlet.port), timeout=5))


def test_ratings_of_several_people_count_and_each_is_told_when(inlet):
    with client(inlet) as one, client(inlet) as other:
        one.sendall(line(BAD))
        other.sendall(line(GOOD) * 2)
        taken = inlet.until(lambda taken: len(taken) == 3)
        assert sorted(rating.rater for _, rating in taken) == ["op1", "op2", "op2"]
        told = [orjson.loads(one.makefile("rb").readline())]
        assert told == [{"tick": tick} for tick, rating in taken if rating == BAD]
        file = other.makefile("rb")
        told = [orjson.loads(file.readline()) for _ in range(2)]
        assert told == [{"tick": tick} for tick, rating in taken if rating == GOOD]


def test_an_inlet_that_nobody_talks_to_takes_no_time(inlet):
    began = time.process_time()
    assert all(inlet.turn() == [] for _ in range(1000))
    assert time.process_time() - began < 0.5


def test_one_who_says_all_and_hangs_up_their_half_gets_every_answer(inlet):
    with client(inlet) as one:
        one.sendall(line(GOOD) * 20 + written(BAD))
        one.shutdown(socket.SHUT_WR)
        taken = inlet.until(lambda taken: len(taken) == 21)
        inlet.until(lambda _: not inlet.talks)
        told = [orjson.loads(answer) for answer in one.makefile("rb").read().splitlines()]
    assert told == [{"tick": tick} for tick, _ in taken]


def test_one_who_is_cut_off_in_the_middle_of_a_line_leaves_no_trace(inlet):
    with client(inlet) as one:
        one.sendall(line(BAD))
        inlet.until(len)
        one.sendall(written(GOOD)[:10])
        one.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # close with a reset
    assert inlet.until(lambda _: not inlet.talks) == []


def test_one_who_floods_and_never_reads_neither_blocks_nor_fills_memory(inlet):
    with client(inlet) as one, client(inlet) as other:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        one.setblocking(False)
        slowest = sent = 0.0
        for _ in range(3000):
            with suppress(BlockingIOError):
                sent += one.send(b"garbage\n" * 500)
            began = time.process_time()
            inlet.turn()
            slowest = max(slowest, time.process_time() - began)
        assert sent > BUFFER
        assert slowest < 0.05
        assert all(talk.room >= 0 and len(talk.data_to_send()) < BUFFER for talk in inlet.talks)
        other.sendall(line(BAD))
        assert [rating for _, rating in inlet.until(len)] == [BAD]


def test_one_too_many_is_told_so_and_a_place_that_is_left_is_free_again(inlet):
    first = [socket.create_connection((HOST, inlet.port), timeout=5) for _ in range(CLIENTS)]
    try:
        inlet.until(lambda _: len(inlet.talks) == CLIENTS)
        with client(inlet) as late:
            inlet.until(lambda _: _readable(late))
            assert "already" in orjson.loads(late.makefile("rb").read())["error"]
        first[0].close()
        inlet.until(lambda _: len(inlet.talks) == CLIENTS - 1)
        with client(inlet) as next_one:
            next_one.sendall(line(BAD))
            assert inlet.until(len)
    finally:
        for connection in first:
            connection.close()


def _readable(connection):
    connection.setblocking(False)
    try:
        return bool(connection.recv(1, socket.MSG_PEEK))
    except BlockingIOError:
        return False
    finally:
        connection.settimeout(5)


def test_it_listens_on_this_machine_only(inlet):
    assert inlet.inlet._lines._listener.getsockname()[0] == "127.0.0.1"


def test_a_port_that_somebody_has_is_refused(inlet):
    with pytest.raises(RatingsError, match=rf"--ratings-port {inlet.port}: "):
        Inlet(inlet.port, count=6)


def test_closing_gives_the_port_back():
    with Inlet(0, count=6) as inlet:
        port = inlet.port
        with client(inlet) as one:
            one.sendall(line(BAD))
            Ticked(inlet).until(len)
    with Inlet(port, count=6) as again:
        assert again.port == port


# --- beside the operator, and in a flight


def test_an_operators_word_and_ratings_come_as_events_of_one_tick():
    said = []
    waiting = [(), (BAD, GOOD), (BAD,)]
    with Operator(said.append, ratings=lambda: waiting.pop(0)) as operator:
        assert operator.events() == ()
        assert operator.events() == (BAD, GOOD)
        assert not said
        os.kill(os.getpid(), 15)
        assert operator.events() == (LAND, BAD)
    assert len(said) == 1


class Person:
    """Watches a flight, and one second into its mission begins to say something each tick."""

    def __init__(self, connection, ratings):
        self._connection, self._ratings = connection, list(ratings)

    def tick(self, tick):
        if self._ratings and tick.diagnosis.mission_s >= 1.0:
            self._connection.sendall(line(self._ratings.pop(0)))


def test_live_ratings_are_recorded_at_the_tick_they_were_answered_with_and_the_flight_can_be_decided_again():
    scenario = load("demo", overrides=[*SHORT, "trust.source=ratings"])
    world, folder = Lockstep.of(scenario, seed=1), scratch()
    with Inlet(0, count=6) as inlet, client(inlet) as one:
        person = Person(one, [BAD] * 6 + [GOOD])
        summary = flown(
            "demo",
            scenario,
            world,
            world,
            seed=1,
            out=folder,
            operator=Saying(inlet.take),
            watching=lambda _flight: (person,),
            ratings=(),
        )
        one.shutdown(socket.SHUT_WR)
        Ticked(inlet).until(lambda _: not inlet._lines._clients)
        answered = [orjson.loads(answer)["tick"] for answer in one.makefile("rb")]
    recorded = [orjson.loads(data) for topic, _, data in messages(folder / "run.mcap") if topic == "/ratings"]
    assert [rating["tick"] for rating in recorded] == answered
    assert [(rating["vehicle"], rating["rating"]) for rating in recorded] == [(5, 1)] * 6 + [("swarm", 4)]
    assert recorded[0]["trust"][4] > 0.5 > recorded[5]["trust"][4]
    assert summary.false_alarms == 1
    assert decide_again(folder).difference is None
