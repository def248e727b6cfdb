"""The frame of a chart: scales, ticks, and what is written around the plot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gcs.report.svg import LETTER, TEXT, Label, apart, element, in_lanes, words

Array = npt.NDArray[np.float64]

WIDTH = 360.0
"""Units: a phone's pixels."""
LEFT, RIGHT = 34.0, 34.0
"""Margins, for figures and for names of lines."""
PLOT = 132.0
"""Height of a plot."""
MOST_NAMES = 9
"""Beside a plot; of more, the last says how many more there are."""


@dataclass(frozen=True, slots=True)
class Scale:
    """Values to units along one axis."""

    low: float
    high: float
    start: float
    """Where low stands."""
    end: float

    def __call__(self, values: Any) -> Any:
        """Units of values, alone or in an array; beyond the ends too."""
        return self.start + (np.asarray(values, np.float64) - self.low) / (self.high - self.low) * (
            self.end - self.start
        )

    def within(self, values: Any) -> Any:
        """The same, kept inside the plot: a line that leaves it runs along its edge."""
        return self(np.clip(values, min(self.low, self.high), max(self.low, self.high)))

    def ticks(self, most: int = 6) -> list[float]:
        """Round values, at most so many and at least two of them where the range holds them."""
        return round_values(self.low, self.high, most)


def figure(value: float) -> str:
    """A round value as it stands beside an axis."""
    return f"{value + 0.0:g}"


def round_values(low: float, high: float, most: int = 6) -> list[float]:
    """1, 2 or 5 times a power of ten apart, within the range."""
    power = 10.0 ** math.floor(math.log10((high - low) / most))
    step = next(
        step for step in (power, 2 * power, 5 * power, 10 * power, 20 * power) if (high - low) / step <= most - 1 + 1e-9
    )
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [round(number * step, 10) for number in range(first, last + 1)]


@dataclass(frozen=True, slots=True)
class Frame:
    """A chart of something over time, empty: what is drawn into it stands on its two scales."""

    time: Scale
    value: Scale
    top: float
    """Height of what is written above the plot."""
    height: float
    """Of the whole chart."""

    @staticmethod
    def of(
        time: tuple[float, float],
        value: tuple[float, float],
        *,
        marks: Sequence[Label] = (),
        unit: str = "",
        strips: int = 0,
        plot: float = PLOT,
    ) -> Frame:
        """With room for these marks above and so many strips below. marks: at times, in seconds."""
        across = Scale(*time, LEFT, WIDTH - RIGHT)
        lanes = 1 + max((lane for lane, _ in _above(marks, across, unit)), default=0)
        top = lanes * (TEXT + 1.0) + 9.0
        bottom = top + plot
        return Frame(
            across,
            Scale(*value, bottom, top),
            top,
            bottom + (strips * STRIP + STRIP / 2 if strips else 0.0) + 2.6 * TEXT,
        )


STRIP = 12.0
"""Height of a strip under a plot; half of it is left free above the first."""


def framed(
    frame: Frame,
    drawn: Sequence[str],
    *,
    title: str,
    description: str,
    unit: str,
    of_value: Sequence[tuple[float, str]] | None = None,
    marks: Sequence[Label] = (),
    names: Sequence[Label] = (),
    time_label: str = "seconds since mission start",
) -> str:
    """The chart. of_value: ticks of the upright axis and their words;  names: of lines, at values, beside the plot."""
    time, value = frame.time, frame.value
    bottom = value.start
    parts = []
    for at, said in of_value if of_value is not None else [(tick, figure(tick)) for tick in value.ticks(5)]:
        y = float(value(at))
        parts.append(element("line", x1=time.start, x2=time.end, y1=y, y2=y, class_="grid"))
        parts.append(words(time.start - 5, y + 0.35 * TEXT, said, "tick y", anchor="end"))
    for at in time.ticks(7):
        x = float(time(at))
        parts.append(
            element("line", x1=x, x2=x, y1=frame.height - 2.6 * TEXT, y2=frame.height - 2.6 * TEXT + 3, class_="axis")
        )
        parts.append(words(x, frame.height - 1.45 * TEXT, figure(at), "tick x", anchor="middle"))
    parts.append(element("line", x1=time.start, x2=time.end, y1=bottom, y2=bottom, class_="axis"))
    parts.append(words((time.start + time.end) / 2, frame.height - 0.25 * TEXT, time_label, "quiet", anchor="middle"))
    parts.append(words(0.0, TEXT, unit, "quiet"))
    for label, (lane, left) in zip(marks, _above(marks, time, unit), strict=True):
        x, base = float(time(label.at)), TEXT + lane * (TEXT + 1.0)
        parts.append(element("line", x1=x, x2=x, y1=base + 2.0, y2=bottom, class_="mark"))
        parts.append(words(left + 2.0, base, label.said, f"marked {label.class_}".strip()))
    parts += drawn
    parts += _beside(frame, names)
    return svg(parts, frame.height, title=title, description=description)


def svg(parts: Sequence[str], height: float, *, title: str, description: str) -> str:
    """A whole chart, as wide as its place, and in words for who cannot see it."""
    return element(
        "svg", "".join(parts), viewBox=f"0 0 {WIDTH:g} {height:g}", role="img", aria_label=f"{title}. {description}"
    )


def _above(marks: Sequence[Label], time: Scale, unit: str) -> list[tuple[int, float]]:
    """Lanes and left edges of marks; the unit stands in the first lane before them."""
    there = [Label(float(time(mark.at)), mark.said) for mark in marks]
    return in_lanes(there, low=LETTER * len(unit) + 6.0, high=WIDTH)


def _beside(frame: Frame, names: Sequence[Label]) -> list[str]:
    """Names of lines at the right, at their last values, moved apart."""
    shown = list(names[:MOST_NAMES])
    wanted = [float(frame.value.within(name.at)) for name in shown]
    places = apart(wanted, least=TEXT, low=frame.top + 4.0, high=frame.value.start)
    said = [
        words(WIDTH - RIGHT + 4.0, y + 0.35 * TEXT, name.said, f"name {name.class_}")
        for y, name in zip(places, shown, strict=True)
    ]
    if len(names) > len(shown):
        said.append(words(WIDTH, frame.height - 1.45 * TEXT, f"+{len(names) - len(shown)}", "quiet", anchor="end"))
    return said
