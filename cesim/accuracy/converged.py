"""Run until an answer is certain enough."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..arguments import seconds
from ..errors import InputError, number, show, unknown
from ..statistics import Estimate
from ..units import to_si
from .quantity import Quantity

if TYPE_CHECKING:
    from ..result import Run

FIRST_LOOK = 1.0  # s of simulated time
LOOKS = (1.1, 1.5)  # between looks the time grows by a factor in this range
CONFIRMED = 1.3  # of the time of the first narrow interval: when it must still be narrow
LEAST_EFFECTIVE = 30.0  # grains; an interval from fewer is not believed
LEAST_STAYS = 3.0  # warm-ups that must have passed, the first of which is cut


@dataclass(frozen=True)
class Converged:
    """Run until the interval of a quantity is narrow enough: ``until=Converged("recovery[copper]", halfwidth=0.01)``.

    Parameters
    ----------
    quantity : str
        "recovery[copper]", "grade[copper]", "middling", "mean_x[copper]" or "spread_x[copper]".
    halfwidth : float or text with a unit
        Half the length of the interval that is asked for; m for mean_x and spread_x.
    level : float
        Coverage of the interval.
    most : text with a unit, or s
        Simulated time after which the run ends anyway, and says so.

    Raises
    ------
    InputError
        Where there is no such quantity, or a number is out of range.

    Notes
    -----
    Landings before `Run.warmup` are cut, the interval is that of ``run.estimate(quantity, warmup="auto")``. It is
    looked at in intervals of simulated time that grow by a factor of 1.1 to 1.5, towards where it should be narrow
    enough by the law of 1/sqrt(time). At least three warm-ups must have passed, and 30 effective grains have landed.

    A width from ten blocks is known to a quarter, and who stops at the first narrow one stops at lucky ones: of 1 200
    runs of independent grains such intervals of 95 % held the truth in 90.7 %. So the run goes on for 0.3 of its
    length, and ends if the interval is narrow then, too: 93.5 %. On a dilute machine 93 to 96 % (docs/accuracy.md).
    """

    quantity: str
    halfwidth: float | str
    level: float = 0.95
    most: float | str = "1000 s"

    def __post_init__(self) -> None:
        if not self.target > 0.0:
            raise InputError(
                f"is {show(self.halfwidth)}, must be above 0", path="Converged.halfwidth", value=self.halfwidth
            )
        if not isinstance(self.level, int | float) or isinstance(self.level, bool) or not 0.0 < self.level < 1.0:
            raise InputError(
                f"is {show(self.level)}, must be between 0 and 1", path="Converged.level", value=self.level
            )
        if self.end <= 0.0:
            raise InputError("is 0 s, must be longer", path="Converged.most", value=self.most, unit="s")

    @property
    def target(self) -> float:
        """The half width in SI units."""
        try:
            return to_si(self.halfwidth, Quantity(self.quantity).unit, 0.0, 1e3)
        except InputError as error:
            raise error.at("Converged.halfwidth") from None

    @property
    def end(self) -> float:
        """The longest run in s."""
        return seconds(self.most, "Converged.most")

    def refuse(self, definition: Mapping[str, Any]) -> None:
        """Raises InputError where a scene never has this quantity."""
        quantity, feed, collect = Quantity(self.quantity), definition["feed"], definition["collect"]
        if feed is None:
            raise InputError("waits for landings, but the scene has no feed", path="until")
        if collect is None:
            raise InputError("waits for landings, but the scene has no landing plane", path="until")
        names = [definition["material_names"][family["material"]] for family in feed["families"]]
        names += [content for name in names for content in (definition.get("contents") or {}).get(name, {})]
        if quantity.material is not None and quantity.material not in names:
            raise unknown("material", quantity.material, names).at("until")
        if quantity.is_share and collect["splitters"] is None:
            raise InputError(f"is {self.quantity}, but the scene has no splitters", path="until")

    def estimate(self, run: Run) -> Estimate:
        """The quantity in a run, with the interval that decides."""
        return Quantity(self.quantity).of(run, self.level, "auto")


class Watch:
    """Looks at a run now and then, and says when it has converged."""

    def __init__(self, goal: Converged) -> None:
        self.goal, self.look = goal, FIRST_LOOK
        self.narrow = False  # at the last look

    def is_due(self, time: float) -> bool:
        """Whether it is time to look."""
        return time >= self.look

    def is_satisfied(self, run: Run) -> bool:
        """Whether the interval is narrow enough; if not, when to look again."""
        least, most = (factor * run.time for factor in LOOKS)
        self.look = most
        if not len(run.landings) or run.time < LEAST_STAYS * run.warmup:
            return False
        if self.goal.quantity.partition("[")[2].rstrip("]") not in ("", *run.materials):
            return False
        estimate = self.goal.estimate(run)
        wide = estimate.halfwidth
        if not wide >= 0.0 or not estimate.n_eff >= LEAST_EFFECTIVE:
            return False
        if wide <= self.goal.target:
            confirmed, self.narrow, self.look = self.narrow, True, CONFIRMED * run.time
            return confirmed
        self.narrow = False
        # The start-up is no part of what the interval comes from.
        wanted = run.warmup + (run.time - run.warmup) * (wide / self.goal.target) ** 2
        self.look = min(max(1.02 * wanted, least), most)
        return False


def verdict(run: Run) -> str:
    """What a run that waited for an interval says of it: a line of its table; "" for other runs."""
    name = str(run.attrs.get("goal_quantity", ""))
    if not name or not len(run.landings):
        return ""
    goal = Converged(name, float(run.attrs["goal_halfwidth"]), float(run.attrs["goal_level"]))
    estimate, scale, unit = goal.estimate(run), 1.0, ""
    if Quantity(name).unit == "m":
        scale, unit = 1e3, " mm"
    reached = "" if estimate.halfwidth <= goal.target else ", NOT reached"
    return (
        f"{name} = {number(scale * float(estimate))} +- {number(scale * estimate.halfwidth)}{unit}, "
        f"{number(scale * goal.target)}{unit} asked for{reached}; from {estimate.n_eff:.0f} effective grains after "
        f"{run.warmup:.2g} s of warm-up"
    )
