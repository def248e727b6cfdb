"""Ratings as people and programs write them: one JSON object a line, in a file, on the live inlet, in a recording.

`{"time_s": 12.3, "rater": "op1", "vehicle": 5, "rating": 2}`, `"vehicle": "swarm"` for all of them, 1 completely
distrust … 5 completely trust. Every refusal names the key, the value and what is allowed.
"""

from __future__ import annotations

import difflib
import math
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from gcs.events import Rating
from gcs.mission import plan
from scenarios import Scenario
from trustr.raters import MODELS
from trustr.rating import HIGHEST, LOWEST

SWARM = "swarm"
LIVE_KEYS = ("rater", "vehicle", "rating")
KEYS = ("time_s", *LIVE_KEYS)
NAME_LENGTH = 40
"""Characters of a rater's name at most."""
RECORDED = ("tick", "trust")
"""Keys that the /ratings topic has besides: a line of it may stand in a file, and these say nothing there."""
SUPERVISOR = 7
"""Keeps a simulated supervisor's randomness apart from the noise of the same seed."""


class RatingsError(ValueError):
    """Ratings that cannot be taken, in one sentence a person can act on."""


def chosen(name_or_path: str, scenario: Scenario, *, seed: int) -> tuple[Rating, ...]:
    """What `--ratings` names: a model of a person, or a file. Raises RatingsError."""
    if name_or_path in MODELS:
        return schedule(name_or_path, scenario, seed)
    path = Path(name_or_path)
    with suppress(OSError):  # too long a name, say
        if path.exists():
            return read(path, count=scenario.swarm.count)
    raise RatingsError(
        f"no ratings {_shown(name_or_path)}: neither a file nor a model of who gives them ({', '.join(MODELS)})"
    )


def schedule(model: str, scenario: Scenario, seed: int) -> tuple[Rating, ...]:
    """What a person of this model, who watches this scenario, would say; in the order of time."""
    ticks = scenario.time.ticks(plan(scenario).read_out_s)
    time_s = np.arange(ticks + 1, dtype=np.float64) * scenario.time.period_s
    faulty = np.zeros((len(time_s), scenario.swarm.count), dtype=bool)
    for fault in scenario.fault:
        if fault.blamed is not None:
            faulty[:, fault.blamed - 1] |= [fault.active(when) for when in time_s.tolist()]
    given = MODELS[model](time_s, faulty, np.random.default_rng([seed, SUPERVISOR]))
    return tuple(
        Rating(rater=model, vehicle=None if row is None else row + 1, rating=rating, time_s=when)
        for when, row, rating in given
    )


def read(path: Path, *, count: int) -> tuple[Rating, ...]:
    """The ratings of a file, for a swarm of `count`, sorted by time. Raises RatingsError."""
    try:
        lines = path.read_bytes().splitlines()
    except OSError as error:
        raise RatingsError(f"{path}: cannot be read: {error.strerror or error}") from None
    ratings = list[tuple[float, Rating]]()
    for number, line in enumerate(lines, start=1):
        if line.strip():
            try:
                rating = parse(line, count=count)
            except RatingsError as error:
                raise RatingsError(f"{path}:{number}: {error}") from None
            assert rating.time_s is not None
            ratings.append((rating.time_s, rating))
    if not ratings:
        raise RatingsError(f"{path}: holds no rating")
    return tuple(rating for _, rating in sorted(ratings, key=lambda pair: pair[0]))


def parse(line: bytes, *, count: int, live: bool = False) -> Rating:
    """One line, for a swarm of `count`; a live one counts at once and has no time. Raises RatingsError."""
    try:
        told = orjson.loads(line)
    except orjson.JSONDecodeError as error:
        raise RatingsError(f"not valid JSON: {error.msg} at column {error.colno}") from None
    if not isinstance(told, dict):
        keys = ", ".join(LIVE_KEYS if live else KEYS)
        raise RatingsError(f"{_shown(told)}: must be a JSON object with the keys {keys}")
    if live:
        _check_keys(told, LIVE_KEYS)
    else:
        _check_keys({key: value for key, value in told.items() if key not in RECORDED}, KEYS)
    return Rating(
        rater=_rater(told["rater"]),
        vehicle=_vehicle(told["vehicle"], count),
        rating=_rating(told["rating"]),
        time_s=None if live else _time_s(told["time_s"]),
    )


def written(rating: Rating) -> bytes:
    """The line that a rating is, without its line's end; one without a time is a live one."""
    time: dict[str, Any] = {} if rating.time_s is None else {"time_s": rating.time_s}
    vehicle = SWARM if rating.vehicle is None else rating.vehicle
    return orjson.dumps(time | {"rater": rating.rater, "vehicle": vehicle, "rating": rating.rating})


def _check_keys(told: dict[str, Any], allowed: tuple[str, ...]) -> None:
    for key, value in told.items():
        if key not in allowed:
            if key == "time_s":
                raise RatingsError(f"time_s = {_shown(value)}: a live rating counts at once and must not have this key")
            close = difflib.get_close_matches(key, allowed, n=1)
            hint = f"did you mean {close[0]}? " if close else ""
            name = key if key.isidentifier() and len(key) <= NAME_LENGTH else _shown(key)
            raise RatingsError(
                f"{name} = {_shown(value)}: there is no such key; {hint}allowed here: {', '.join(allowed)}"
            )
    for key in allowed:
        if key not in told:
            raise RatingsError(f"{key}: this key is missing")


def _time_s(value: Any) -> float:
    if _is_number(value) and math.isfinite(value) and value >= 0:
        return float(value)
    raise RatingsError(f"time_s = {_shown(value)}: must be a number of seconds since mission start, 0 or more")


def _rater(value: Any) -> str:
    if isinstance(value, str) and value.isprintable() and 1 <= len(value) <= NAME_LENGTH:
        return value
    raise RatingsError(f"rater = {_shown(value)}: must be a name of 1 to {NAME_LENGTH} printable characters")


def _vehicle(value: Any, count: int) -> int | None:
    if value == SWARM:
        return None
    if _is_whole(value) and 1 <= value <= count:
        return int(value)
    raise RatingsError(f'vehicle = {_shown(value)}: there is no such vehicle; allowed are 1 to {count}, or "{SWARM}"')


def _rating(value: Any) -> int:
    if _is_whole(value) and LOWEST <= value <= HIGHEST:
        return int(value)
    raise RatingsError(
        f"rating = {_shown(value)}: must be a whole number from {LOWEST:g}, completely distrust, to {HIGHEST:g}, "
        "completely trust"
    )


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_number(value: Any) -> bool:
    return isinstance(value, float) or _is_whole(value)


def _shown(value: Any) -> str:
    """A value as it stands in a refusal: on one line, and not longer than a person wants to read."""
    shown = repr(value)
    return shown if len(shown) <= 60 else f"{shown[:57]}..."
