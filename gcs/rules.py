"""Update rules by name: those that ship, and a researcher's own, `package.module:function` (docs/your-own-rule.md).

A rule from outside is tried once on the ground, and what it returns is checked at every tick.
"""

from __future__ import annotations

import hashlib
import importlib
import sys
import traceback
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from trustr.consensus import RULES, Agreement, Heard, Rule
from trustr.controller import Settings
from trustr.network import Array, neighbours

ROUNDING = 1e-9
"""Each robot's weights sum to 1 within this."""


class RuleError(ValueError):
    """A rule that cannot be flown, in one sentence."""


def rule(name: str) -> Rule:
    """The rule of this name. Raises RuleError where there is none, or where importing it fails."""
    return RULES[name] if name in RULES else _watched(name, _imported(name))


def rehearse(settings: Settings) -> None:
    """Ask the rule once, for a formation that flies, before one does. Raises RuleError."""
    count = len(settings.offset_ne)
    graph = neighbours(settings.offset_ne, np.ones(count, bool), range_m=settings.range_m)
    velocity = 1.0 + 0.01 * np.arange(2.0 * count).reshape(count, 2)
    settings.rule(Heard(graph, velocity, np.ones(count), 0.0, velocity, np.zeros(count)), settings)


@cache
def source_digest(name: str) -> str:
    """Of the files that hold a rule from outside, as this process first found them: imported once, they are what flies.

    Raises RuleError.
    """
    function = _imported(name)
    modules = {name.partition(":")[0], getattr(function, "__module__", None)}
    files = {getattr(sys.modules.get(module or ""), "__file__", None) for module in modules}
    hashed = hashlib.sha256()
    for file in sorted(file for file in files if file is not None):
        hashed.update(Path(file).read_bytes())
    return hashed.hexdigest()[:20]


def _imported(name: str) -> Callable[..., Any]:
    """The function behind `package.module:function`; modules of the current directory come first, as in `python -m`."""
    module, _, function = name.partition(":")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)
    importlib.invalidate_caches()
    try:
        found = importlib.import_module(module)
    except (Exception, SystemExit) as error:
        if isinstance(error, ModuleNotFoundError) and f"{module}.".startswith(f"{error.name}."):
            raise _refusal(name, f"there is no module {error.name}, neither in {here} nor installed") from None
        raise _refusal(name, f"importing {module} raised {_in_a_line(error)}") from error
    chosen = getattr(found, function, None)
    if chosen is None:
        raise _refusal(name, f"{getattr(found, '__file__', None) or module} has no function {function}")
    if not callable(chosen):
        raise _refusal(name, f"{function} is no function but a {type(chosen).__name__}")
    return chosen  # type: ignore[no-any-return]


def _watched(name: str, function: Callable[..., Any]) -> Rule:
    """The same, with a sentence for whatever goes wrong in it."""

    def watched(heard: Heard, settings: Settings) -> Agreement:
        try:
            answer = function(_sealed(heard), settings)
        except (Exception, SystemExit) as error:
            within = traceback.extract_tb(error.__traceback__)[1:2]
            place = f" at {Path(within[0].filename).name}:{within[0].lineno}" if within else ""
            raise _refusal(name, f"it raised {_in_a_line(error)}{place}") from error
        return _checked(name, answer, heard)

    return watched


def _checked(name: str, answer: object, heard: Heard) -> Agreement:
    """An answer that the controller can go by. Raises RuleError."""
    if not isinstance(answer, Agreement):
        raise _refusal(name, f"it returned a {type(answer).__name__}, not a trustr.consensus.Agreement")
    count, edges = heard.graph.count, len(heard.graph.sender)
    velocity = _numbers(name, "velocity_ne", answer.velocity_ne, (count, 2))
    weights = _numbers(name, "weights", answer.weights, (edges,))
    if (weights < 0.0).any():
        raise _refusal(name, f"it returned a weight of {weights.min():g}; none may be below 0")
    sums = heard.graph.sum_by_receiver(weights)
    worst = int(np.argmax(np.abs(sums - 1.0)))
    if abs(sums[worst] - 1.0) > ROUNDING:
        raise _refusal(name, f"its weights for vehicle {worst + 1} sum to {sums[worst]:.12g}, not 1")
    return Agreement(velocity, weights)


def _numbers(name: str, field: str, value: object, shape: tuple[int, ...]) -> Array:
    """A field of the answer as an array of this shape. Raises RuleError."""
    try:
        array = np.asarray(value)
    except ValueError:
        raise _refusal(name, f"it returned {field} that make no array") from None
    if array.shape != shape:
        raise _refusal(name, f"it returned {field} of shape {array.shape}, not {shape}")
    if array.dtype.kind not in "iuf":
        raise _refusal(name, f"it returned {field} of type {array.dtype}, not numbers")
    if not np.isfinite(array).all():
        raise _refusal(name, f"it returned {field} that are not all finite")
    return array.astype(np.float64, copy=False)


def _sealed(heard: Heard) -> Heard:
    """The same, read-only: the controller goes on with these very arrays."""
    graph = heard.graph
    return replace(
        heard,
        graph=replace(
            graph,
            receiver=_read_only(graph.receiver),
            sender=_read_only(graph.sender),
            distance=_read_only(graph.distance),
        ),
        velocity_ne=_read_only(heard.velocity_ne),
        trust=_read_only(heard.trust),
        first_ne=_read_only(heard.first_ne),
        standing=_read_only(heard.standing),
    )


def _read_only(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    view = array.view()
    view.flags.writeable = False
    return view


def _refusal(name: str, why: str) -> RuleError:
    return RuleError(f"control.rule = {name!r}: {why}")


def _in_a_line(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())
