"""Charts of what lies beneath a flight: links, batteries, the loop's own timing, and the gate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gcs.flight_state import Phase
from gcs.gate import FENCED, LATE_PERIODS, LOST_NS, REFUSED, SLOWED, WITHHELD
from gcs.recording.history import Integers
from gcs.report.axes import STRIP, Frame, framed
from gcs.report.robots import Drawn, Section, key, line, swarm
from gcs.report.series import lost_share
from gcs.report.svg import TEXT, Label, element, hover, path, words
from gcs.report.telling import capital, some
from gcs.report.told import Told
from gcs.words import robots

Array = npt.NDArray[np.float64]

CHANGES = {SLOWED: "slowed", REFUSED: "refused", FENCED: "fenced", WITHHELD: "withheld"}
"""Verdicts that are not what was asked, as they are drawn and called."""
MEANT = {
    SLOWED: "slowed",
    REFUSED: "asked to stop",
    FENCED: "kept inside the fence",
    WITHHELD: "nothing sent",
}
LOW = 72.0
"""Height of the plots of this page's last part."""
NO_TICKS = "There is not one tick in the recording."


def links(flights: Sequence[Told]) -> Section:
    """How old telemetry was, and what was lost on the way."""
    oldest = [float(np.nanmax(told.history.age_s, initial=0.0)) for told in flights]
    top = max(0.2, 1.1 * max(oldest))
    return Section(
        "links",
        "Links",
        f"The age of what each vehicle last told of itself. Above the dashed line, at {LOST_NS / 1e9:g} s, it is taken "
        "for lost and sent nothing.",
        (*key(flights), ("limit", "taken for lost")),
        tuple(_links(told, flights, top, worst) for told, worst in zip(flights, oldest, strict=True)),
    )


def batteries(flights: Sequence[Told]) -> Section:
    """How full batteries were."""
    return Section(
        "battery",
        "Battery",
        "What each autopilot told of its battery. One that falls faster than the others has more work, or is older.",
        key(flights),
        tuple(_battery(told, flights) for told in flights),
    )


def lateness(flights: Sequence[Told]) -> Section:
    """How late ticks were decided."""
    top = max(1.0, *(1.1e3 * float(np.nanmax(told.history.lateness_s, initial=0.0)) for told in flights))
    return Section(
        "loop",
        "Timing of the loop",
        f"How long after its deadline each tick was decided. One that is more than {LATE_PERIODS} periods late asks "
        "nobody to move.",
        (("mean", "lateness"),),
        tuple(_lateness(told, flights, top) for told in flights),
    )


def gate(flights: Sequence[Told]) -> Section:
    """Which set-points left otherwise than they were asked for."""
    return Section(
        "gate",
        "Set-points that the gate changed",
        "Whatever the controller asks for passes limits and fence before it is sent. A bar is a time at which a robot "
        "was sent something else.",
        tuple((f"{class_} bar", MEANT[code]) for code, class_ in CHANGES.items() if _any(flights, code)),
        tuple(_gate(told, flights) for told in flights),
    )


def _frame(told: Told, flights: Sequence[Told], value: tuple[float, float], unit: str, plot: float = LOW) -> Frame:
    """Over the whole of all flights, take-off and landing included."""
    known = [other.since_s for other in flights if other.since_s.size]
    low, high = min(float(times[0]) for times in known), max(float(times[-1]) for times in known)
    return Frame.of((low, max(high, low + 1.0)), value, marks=_marks(told), unit=unit, plot=plot)


def _marks(told: Told) -> list[Label]:
    phases = [(Phase.MISSION, "mission"), (Phase.HOLD, "holding"), (Phase.LAND, "landing")]
    begins = [
        (told.history.phase.index(phase.value), name) for phase, name in phases if phase.value in told.history.phase
    ]
    return [Label(float(told.since_s[row]), name) for row, name in begins]


def _any(flights: Sequence[Told], code: int) -> bool:
    return any((told.history.verdict == code).any() for told in flights)


def _links(told: Told, flights: Sequence[Told], top: float, oldest: float) -> Drawn:
    if not told.since_s.size:
        return Drawn("", NO_TICKS)
    if told.history.links is None and oldest == 0.0:
        return Drawn("", "Flown in lockstep: every frame arrives, in the tick that it was sent in.")
    frame = _frame(told, flights, (0.0, top), "seconds")
    parts = swarm(frame, told, told.all_rows, told.history.age_s)
    if top > LOST_NS / 1e9:
        y = float(frame.value(LOST_NS / 1e9))
        parts.append(element("line", x1=frame.time.start, x2=frame.time.end, y1=y, y2=y, class_="limit"))
    lost = told.history.links
    if lost is not None and len(lost.time_ns) > 1:
        share = lost_share(lost).max(axis=1)
        if share.any():
            at = frame.time((lost.time_ns[1:] - told.history.time_ns[0]) / 1e9 + told.since_s[0])
            parts.append(
                path(at, frame.value(share * top), "loss", "frames lost of the worst heard, full height is all")
            )
    said = f"{_lost_in_words(told)} {_age_in_words(told)}"
    svg = framed(frame, parts, title="Links", description=said, unit="seconds", marks=_marks(told))
    return Drawn(svg, said)


def _lost_in_words(told: Told) -> str:
    lost = told.history.links
    if lost is None or not len(lost.time_ns):
        return "The link does not tell what it lost."
    missing = {
        system: gone / (gone + came)
        for system, gone, came in zip(told.history.ids, lost.lost[-1].tolist(), lost.received[-1].tolist(), strict=True)
        if gone
    }
    if not missing:
        return "Not one frame was lost."
    worst = max(missing, key=missing.__getitem__)
    return (
        f"Frames were lost of {len(missing)} of {told.count} robots, of robot {worst} the most: {missing[worst]:.1%}."
    )


def _age_in_words(told: Told) -> str:
    """Who fell silent, and how old telemetry of the others grew."""
    ever = told.silent.any(axis=0)
    if not ever.any():
        return f"Telemetry was never older than {float(np.nanmax(told.history.age_s, initial=0.0)):.2f} s."
    ids, age_s = told.history.ids, told.history.age_s
    lost = [
        f"robot {ids[row]} was not heard for {float(np.nanmax(age_s[:, row])):.1f} s"
        + (", to the end" if told.silent[-1, row] else "")
        for row in np.flatnonzero(ever)
    ]
    heard = age_s[:, ~ever]
    others = f"; telemetry of the others was never older than {float(np.nanmax(heard)):.2f} s" if heard.size else ""
    return capital(f"{some(lost, between='; ')}{others}.")


def _battery(told: Told, flights: Sequence[Told]) -> Drawn:
    value = told.history.battery
    if not np.isfinite(value).any():
        return Drawn("", "No vehicle told of its battery.")
    frame = _frame(told, flights, (0.0, 100.0), "percent")
    at_the_end = [
        (column[np.isfinite(column)][-1], system)
        for column, system in zip(value.T, told.history.ids, strict=True)
        if np.isfinite(column).any()
    ]
    (least, whose), (most, _) = min(at_the_end), max(at_the_end)
    whom = "of all alike" if least == most else f"of robot {whose}, and {most:.0%} at the most"
    said = f"From {np.nanmax(value):.0%} to {least:.0%} {whom}."
    svg = framed(
        frame,
        swarm(frame, told, told.all_rows, 100.0 * value),
        title="Battery",
        description=said,
        unit="percent",
        of_value=((0.0, "0"), (50.0, "50"), (100.0, "100")),
        marks=_marks(told),
    )
    return Drawn(svg, said)


def _lateness(told: Told, flights: Sequence[Told], top: float) -> Drawn:
    late_ms, frames = told.history.lateness_s * 1e3, told.history.frames
    if not late_ms.size:
        return Drawn("", NO_TICKS)
    taken = f"Frames that came in a tick: {_spread(frames, '.0f')}."
    if not (late_ms > 0.0).any():
        return Drawn("", f"Every one of {len(late_ms)} ticks was decided on time. {taken}")
    said = f"Late by {_spread(late_ms, '.1f', ' ms')}. {taken}"
    frame = _frame(told, flights, (0.0, top), "ms")
    svg = framed(
        frame,
        [line(frame, told, told.all_rows, late_ms, "mean thin")],
        title="Timing of the loop",
        description=said,
        unit="ms",
        marks=_marks(told),
    )
    return Drawn(svg, said)


def _spread(values: Array | Integers, form: str, unit: str = "") -> str:
    median, high = (format(float(np.percentile(values, share)), form) for share in (50, 99))
    return f"{median}{unit} in the median, {high}{unit} at p99, {format(float(values.max()), form)}{unit} at most"


def _gate(told: Told, flights: Sequence[Told]) -> Drawn:
    verdict = told.history.verdict
    asked = int((verdict >= 0).sum())
    if not asked:
        return Drawn("", "No set-point was asked for.")
    changed = {code: int((verdict == code).sum()) for code in CHANGES}
    told_of = [f"{count} {MEANT[code]}" for code, count in changed.items() if count]
    if not told_of:
        return Drawn("", f"All {asked} set-points left as they were asked for.")
    said = f"Of {asked} set-points: {', '.join(told_of)}."
    rows = np.flatnonzero(np.isin(verdict, list(CHANGES)).any(axis=0)).tolist()
    shown = rows[:MOST_ROWS]
    if len(rows) > len(shown):
        whom = robots([told.history.ids[row] for row in shown])
        said += f" Drawn are {whom}; {len(rows) - len(shown)} more had some too."
    frame = _frame(told, flights, (0.0, 1.0), "robot", plot=STRIP * len(shown) + 4.0)
    parts = [part for place, row in enumerate(shown) for part in _changes(told, frame, row, place)]
    svg = framed(frame, parts, title="Gate", description=said, unit="robot", of_value=(), marks=_marks(told))
    return Drawn(svg, said)


MOST_ROWS = 10
"""Robots with a strip of their own."""


def _changes(told: Told, frame: Frame, row: int, place: int) -> list[str]:
    """One robot's strip."""
    y = frame.top + 4.0 + place * STRIP
    system, verdict = told.history.ids[row], told.history.verdict[:, row]
    parts = [words(frame.time.start - 5, y + 0.75 * TEXT, str(system), "tick y", anchor="end")]
    period_s = told.history.scenario.time.period_s
    for code, class_ in CHANGES.items():
        edges = np.flatnonzero(np.diff(verdict == code, prepend=False, append=False))
        for begin, end in edges.reshape(-1, 2):
            from_s, to_s = told.since_s[begin], told.since_s[end - 1] + period_s
            x, width = float(frame.time(from_s)), float(frame.time(to_s) - frame.time(from_s))
            title = hover(f"robot {system} {MEANT[code]}, {from_s:.1f} s to {to_s:.1f} s")
            parts.append(
                element("rect", title, x=x, y=y, width=max(width, 1.0), height=STRIP - 4.0, class_=f"{class_} bar")
            )
    return parts
