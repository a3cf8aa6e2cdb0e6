"""What each effect does to the answer: predicted by single flights, timed, and measured by switching it over.

`cesim.effects.predict(scene)` is `scene.effects()`; `measure` adds the share of the run time; `audit` runs a sample of
the feed with each effect the other way round and says which decisions were right.
"""

from __future__ import annotations

from .audits import Audit, audit
from .cost import measure
from .prediction import predict

__all__ = ["Audit", "audit", "measure", "predict"]
