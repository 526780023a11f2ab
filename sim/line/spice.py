# SPDX-License-Identifier: Apache-2.0
"""The networks of the cross-check in ngspice, and the stored reference waveforms.

usage: python -m sim.line.spice [--write]
Runs ngspice on every case, compares the model with it and prints the differences; --write stores the waveforms
(sim/line/reference/*.csv, one value per REFERENCE_NS) that the tests compare with where ngspice is missing.
The netlists are made from the same description, with sections of SPICE_SECTION_M, five times as fine as the model's, so
that its lumping is checked as well as its matrices and its discretisation. Requirements: AN-002 (docs/requirements.md).
"""
import argparse
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from asi.telegram import pulses, request_word, response_word

from .network import CLOCK_S, EDGE_S, FLOOR_F, Line, Segment, bus, edge_current
from .network import point_to_point, superpose, tree

REFERENCE = Path(__file__).parent / "reference"
REFERENCE_NS = 500.0            # 8 receiver clocks
CLOCKS = 1600                   # 100 us
LEAD_NS = 5_000.0
SPICE_STEP_S = 20e-9          # longest step of ngspice
SPICE_SECTION_M = 1.0
AMPS = 0.06


@dataclass(frozen=True)
class Case:
    """A telegram from one sender, seen at some nodes."""
    name: str
    segment: Segment
    sender: str
    word: int
    bits: int
    probes: tuple[str, ...]

    def train(self) -> list[tuple[float, int]]:
        return [(LEAD_NS + t, p) for t, p in pulses(self.word, self.bits)]


CASES = (
    Case("short", point_to_point(10.0), "master", request_word(0x0AA), 14, ("master", "far")),
    Case("bus100", bus(100.0, 31), "far", response_word(6), 7, ("master", "n15", "far")),
    Case("tree", tree(), "master", request_word(0x2B3), 14, ("master", "s1", "far")),
)


def netlist(case: Case, output: str) -> str:
    """A complete ngspice input; `output` receives time and probe voltages."""
    seg, lines = case.segment, [f"* {case.name}"]
    cable = seg.cable
    caps = {node: FLOOR_F for node in seg.nodes}
    siemens = {node: 0.0 for node in seg.nodes}
    for k, (a, b, metres) in enumerate(seg.cables):
        count = int(np.ceil(metres / SPICE_SECTION_M))
        part = metres / count
        chain = [a, *(f"c{k}_{j}" for j in range(1, count)), b]
        for j, (p, q) in enumerate(zip(chain, chain[1:])):
            for node in (p, q):
                caps[node] = caps.get(node, 0.0) + cable.c * part / 2
                siemens[node] = siemens.get(node, 0.0) + cable.g * part / 2
            lines += [f"Lc{k}_{j} {p} m{k}_{j} {cable.l * part:.9g}", f"Rc{k}_{j} m{k}_{j} {q} {cable.r * part:.9g}"]
    for k, (node, load) in enumerate(seg.loads):
        caps[node] += load.farad
        siemens[node] += 1 / load.ohm if load.ohm else 0.0
        if load.henry:
            lines.append(f"Ll{k} {node} lr{k} {load.henry:.9g}\nRl{k} lr{k} 0 1m")   # no loop of inductors
    lines += [f"Lp {seg.power} pr {seg.decoupling_h:.9g}", "Rps pr 0 1m", f"Rp {seg.power} 0 {seg.decoupling_ohm:.9g}"]
    for node in caps:
        lines += [f"C_{node} {node} 0 {caps[node]:.9g}"]
        if siemens[node]:
            lines += [f"R_{node} {node} 0 {1 / siemens[node]:.9g}"]
    points, level = ["0 0"], 0.0
    shape = np.arange(0, EDGE_S + 1e-12, 30e-9)
    for t_ns, polarity in case.train():
        for at in shape[1:] if points[-1].startswith(f"{t_ns * 1e-9:.12g} ") else shape:
            points.append(f"{t_ns * 1e-9 + at:.12g} {AMPS * (level - polarity * float(edge_current(at))):.9g}")
        level -= polarity
    lines += [f"Isend {case.sender} 0 PWL("] + [f"+ {p}" for p in points] + ["+ )"]
    end = CLOCKS * CLOCK_S
    lines += [".options reltol=1e-4 abstol=1e-8 vntol=1e-5", f".tran {SPICE_STEP_S:.3g} {end:.6g} 0 {SPICE_STEP_S:.3g}",
              ".control", "run", "set wr_singlescale", "set wr_vecnames", "set numdgt=8",
              f"wrdata {output} {' '.join(f'v({p})' for p in case.probes)}", ".endc", ".end"]
    return "\n".join(lines) + "\n"


def run(case: Case, program: str = "ngspice") -> np.ndarray:
    """[probe, receiver clock] in V from ngspice; RuntimeError with its last lines when it fails."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.cir"
        path.write_text(netlist(case, "out.txt"))
        done = subprocess.run([program, "-b", path.name], cwd=folder, capture_output=True, text=True, timeout=120)
        result = Path(folder) / "out.txt"
        if not result.exists():
            raise RuntimeError(f"{program}: {case.name}: " + " | ".join((done.stdout + done.stderr).splitlines()[-5:]))
        table = np.loadtxt(result, skiprows=1)
    clocks = np.arange(CLOCKS) * CLOCK_S
    return np.array([np.interp(clocks, table[:, 0], table[:, 1 + k]) for k in range(len(case.probes))])


def model(case: Case) -> np.ndarray:
    """The same from sim.line.network."""
    responses = Line(case.segment, [case.sender], case.probes).edge_responses()
    return np.array([superpose(responses[k, 0], case.train(), AMPS, 0.0, CLOCKS) for k in range(len(case.probes))])


def starts(volts: np.ndarray, times_ns: np.ndarray) -> np.ndarray:
    """Interpolated times in ns where |v| first exceeds half its maximum, pulse by pulse."""
    half = np.abs(volts).max() / 2
    out = []
    for sign in (-1, 1):
        v = sign * volts - half
        up = np.flatnonzero((v[:-1] <= 0) & (v[1:] > 0))
        out += list(times_ns[up] + (times_ns[up + 1] - times_ns[up]) * v[up] / (v[up] - v[up + 1]))
    return np.sort(out)


@dataclass(frozen=True)
class Difference:
    """Model against reference, at one probe."""
    max_mv: float
    rms_mv: float
    max_percent: float       # of the largest voltage
    rms_percent: float
    start_ns: float          # largest difference of a pulse start; NaN: not measured


def compare(found: np.ndarray, reference: np.ndarray, step_ns: float, with_starts: bool = True) -> Difference:
    error, top = found - reference, np.abs(reference).max()
    late = float("nan")
    if with_starts:
        t = np.arange(len(reference)) * step_ns
        a, b = starts(found, t), starts(reference, t)
        late = float(np.abs(a - b).max()) if len(a) == len(b) else float("inf")
    rms = float(np.sqrt(np.mean(error ** 2)))
    worst = float(np.abs(error).max())
    return Difference(worst * 1e3, rms * 1e3, 100 * worst / top, 100 * rms / top, late)


def decimated(volts: np.ndarray) -> np.ndarray:
    """One value per REFERENCE_NS (no filter: values, not a picture)."""
    return volts[:, ::round(REFERENCE_NS / (CLOCK_S * 1e9))]


def write_reference(case: Case, volts: np.ndarray) -> Path:
    REFERENCE.mkdir(exist_ok=True)
    path = REFERENCE / f"{case.name}.csv"
    rows = ["# SPDX-License-Identifier: Apache-2.0",
            f"# ngspice, {case.name}: {case.bits}-bit telegram 0x{case.word:04X} from {case.sender}, "
            f"{AMPS * 1e3:.0f} mA; mV every {REFERENCE_NS:.0f} ns", ",".join(case.probes)]
    rows += [",".join(f"{1e3 * v:.1f}" for v in row) for row in decimated(volts).T]
    path.write_text("\n".join(rows) + "\n")
    return path


def read_reference(case: Case) -> np.ndarray:
    """[probe, sample] in V, one sample per REFERENCE_NS."""
    return np.loadtxt(REFERENCE / f"{case.name}.csv", delimiter=",", skiprows=3, ndmin=2).T / 1e3


def main() -> None:
    from rich.console import Console
    from rich.table import Table
    parser = argparse.ArgumentParser(prog="python -m sim.line.spice", description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="store the ngspice waveforms")
    args = parser.parse_args()
    table = Table("network", "at", "max mV", "max %", "rms mV", "rms %", "pulse start ns", title="model - ngspice")
    for case in CASES:
        spice, own = run(case), model(case)
        for k, probe in enumerate(case.probes):
            d = compare(own[k], spice[k], CLOCK_S * 1e9)
            table.add_row(case.name, probe, f"{d.max_mv:.1f}", f"{d.max_percent:.2f}", f"{d.rms_mv:.2f}",
                          f"{d.rms_percent:.3f}", f"{d.start_ns:.1f}")
        if args.write:
            write_reference(case, spice)
    Console().print(table)


if __name__ == "__main__":
    main()
