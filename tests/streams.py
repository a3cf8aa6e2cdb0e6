"""A stream of grains that falls straight onto a landing plane in 0.1 s, for tests of what comes after the engine."""

import cesim


def stream(rate: str = "20000 1/s") -> cesim.Scene:
    return cesim.Scene(
        name="stream",
        feed=cesim.Feed(
            rate=rate,
            mix={"copper": 0.3, "ABS": 0.7},
            size=cesim.LogNormal(median="0.7 mm", gsd=1.2, least="0.4 mm", most="1.2 mm"),
            outlet=cesim.Outlet(center=(0.0, 0.05, 0.0), length=0.1, width=0.1),
            velocity=(0.3, -0.3, 0.0),
        ),
        collect=cesim.Collect(y=0.0, splitters=(0.0, 0.03), bins={"n": 40, "x": (-0.1, 0.1)}),
    )
