"""What accuracy costs: how certain an answer is, what makes it wrong, and which settings to use."""

from __future__ import annotations

from .comparison import Comparison, compare
from .converged import Converged
from .measure import accuracy_report
from .quantity import Difference, Quantity, difference, pooled
from .report import Choice, Report
from .rules import PRESETS, Recommendation, preset, recommend

__all__ = [
    "PRESETS",
    "Choice",
    "Comparison",
    "Converged",
    "Difference",
    "Quantity",
    "Recommendation",
    "Report",
    "accuracy_report",
    "compare",
    "difference",
    "pooled",
    "preset",
    "recommend",
]
