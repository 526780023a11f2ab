# SPDX-License-Identifier: Apache-2.0
"""A short exchange on the modelled line as a voltage capture (CSV), as an oscilloscope between the wires would give it.

usage: python -m sim.line.capture FILE.csv
`python -m asi decode FILE.csv` decodes it. Requirements: AN-011 (docs/requirements.md).
"""
import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from asi.telegram import encode_call, request_pulses, response_pulses

from .network import CLOCK_S, Line, Segment, bus, superpose

DC_V = 30.0                  # at the power unit 29.5..31.6 V
LEAD_NS, SYNC_NS, NEXT_NS = 200_000.0, 21_500.0, 18_500.0
AMPS = 0.06
EXAMPLE = ((encode_call("RDID", 5), 0x0), (encode_call("WPAR", 5, 0xF), 0xF), (encode_call("DEXG", 5, 0b1010), 0b0011),
           (encode_call("DEXG", 6, 0b0101), None), (encode_call("DEXG", 5, 0b0101), 0b0110))


def volts(exchanges: Sequence[tuple[int, int | None]], segment: Segment | None = None, probe: str = "master",
          noise_v: float = 0.02, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Times (s) and line voltage (V, with its DC) at `probe`, one value per 62.5 ns.

    exchanges: (11-bit call, answer nibble or None for silence); the master is at 'master', the slaves at 'far'.
    """
    line = Line(segment or bus(), ("master", "far"), (probe,)).edge_responses()
    trains: tuple[list, list] = ([], [])
    t = LEAD_NS
    for call, answer in exchanges:
        trains[0].extend((t + at, p) for at, p in request_pulses(call))
        t += 78_000.0
        if answer is None:
            t += 66_000.0 + 6_000.0
        else:
            trains[1].extend((t + SYNC_NS + at, p) for at, p in response_pulses(answer))
            t += SYNC_NS + 36_000.0 + NEXT_NS
    clocks = round((t + LEAD_NS) * 1e-9 / CLOCK_S)
    v = DC_V + sum(superpose(line[0, k], train, AMPS, 0.0, clocks) for k, train in enumerate(trains))
    v += noise_v * np.random.default_rng(seed).standard_normal(clocks)
    return np.arange(clocks) * CLOCK_S, v


def write_csv(path: Path, times: np.ndarray, values: np.ndarray, every: int = 2) -> None:
    """One row per `every` clocks: time in us, voltage in V."""
    rows = (f"{1e6 * t:.4f},{v:.3f}" for t, v in zip(times[::every], values[::every]))
    path.write_text("time [us],u [V]\n" + "\n".join(rows) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m sim.line.capture", description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path)
    write_csv(parser.parse_args().file, *volts(EXAMPLE))


if __name__ == "__main__":
    main()
