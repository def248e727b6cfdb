"""The options by which people, or models of people, say during a flight whom to trust."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

if TYPE_CHECKING:
    from gcs.events import Rating
    from scenarios import Scenario


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Supervision:
    """Who watches the flight, and says whom to trust."""

    ratings: Annotated[str | None, Parameter(help="A file of ratings, or a simulated supervisor's name.")] = None
    ratings_port: Annotated[
        int | None, Parameter(help="Take ratings while flying, by TCP on this machine; 0 is any free port.")
    ] = None

    def known(self, scenario: Scenario, *, seed: int | None) -> tuple[Rating, ...] | None:
        """Ratings known beforehand; None where nobody will rate at all. Raises RatingsError."""
        from gcs.ratings import RatingsError, chosen

        if self.ratings is None and self.ratings_port is None:
            return None
        source = scenario.trust.source
        if not takes_ratings(scenario):
            option = "--ratings" if self.ratings is not None else "--ratings-port"
            raise RatingsError(f"{option}: trust from {source} takes no ratings; --trust ratings and fused do")
        if self.ratings_port is not None and not 0 <= self.ratings_port <= 65535:
            raise RatingsError(f"--ratings-port {self.ratings_port}: must be 0 to 65535")
        return () if self.ratings is None else chosen(self.ratings, scenario, seed=1 if seed is None else seed)

    def live(
        self, stack: ExitStack, scenario: Scenario, say: Callable[[str], None]
    ) -> Callable[[], tuple[Rating, ...]]:
        """Where live ratings come from, open as long as the stack. Raises RatingsError."""
        from gcs.inlet import Inlet

        if self.ratings_port is None:
            return tuple
        inlet = stack.enter_context(Inlet(self.ratings_port, count=scenario.swarm.count))
        say(f"ratings are taken at 127.0.0.1, port {inlet.port}")
        return inlet.take


NOBODY = Supervision()
"""Nobody watches."""


def takes_ratings(scenario: Scenario) -> bool:
    """Whether its trust listens to people."""
    return scenario.trust.source in ("ratings", "fused")
