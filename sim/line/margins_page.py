# SPDX-License-Identifier: Apache-2.0
"""docs/margins.md and its plots from the measured data (matplotlib)."""
import os
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("svg")
import matplotlib.pyplot as plt  # noqa: E402 - after the choice of its output

from asi.telegram import encode_call  # noqa: E402

from .exchange import ANSWER_LEAD_NS, Hop, Setup, exchange  # noqa: E402
from .front_end import CLOCK_NS, Comparators  # noqa: E402
from .margins import WAYS, mc_rows, sweep_rows  # noqa: E402
from .network import bus  # noqa: E402
from .spice import CASES, compare, decimated, model, read_reference  # noqa: E402

COLOURS = {"request": "#1f6fb4", "answer": "#d1701f"}
plt.rcParams.update({"svg.hashsalt": "asi", "svg.fonttype": "none", "font.size": 8, "axes.grid": True,
                     "grid.alpha": 0.3, "axes.spines.top": False, "axes.spines.right": False})


def _save(figure, path: Path) -> None:
    figure.savefig(path, metadata={"Date": None, "Creator": None})
    plt.close(figure)
    # the renderer leaves blanks at line ends; a clean diff wants none
    path.write_text("\n".join(line.rstrip() for line in path.read_text().splitlines()) + "\n")


def plot_sweeps(data: dict[str, Any], path: Path) -> None:
    columns = 4
    rows = -(-len(data["sweeps"]) // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(12, 2.1 * rows), layout="constrained")
    for axis, entry in zip(axes.flat, data["sweeps"]):
        for where, style in zip(WAYS, ("-", "--")):
            x = [p["value"] for p in entry["points"]]
            y = [100 * p[where]["failed"] / p[where]["telegrams"] for p in entry["points"]]
            axis.plot(x, y, color=COLOURS[where], linestyle=style, linewidth=1.3, label=where)
            if entry["limits"][where] is not None:
                axis.axvline(entry["limits"][where], color=COLOURS[where], linestyle=":", linewidth=1.2)
        words, lines = entry["title"].split(), [""]
        for word in words:
            fits = len(lines[-1]) + len(word) < 38
            lines = [*lines[:-1], f"{lines[-1]} {word}".strip()] if fits else [*lines, word]
        axis.set_title("\n".join(lines), fontsize=8)
        axis.set_xlabel(entry["unit"])
        axis.set_ylim(-4, 104)
        if x[0] > x[-1]:
            axis.invert_xaxis()
        axis.set_yticks([0, 50, 100])
        if entry["name"] == "damping":
            axis.set_xscale("log")
        else:
            axis.locator_params(axis="x", nbins=5)
    for axis in list(axes.flat)[len(data["sweeps"]):]:
        axis.axis("off")
    axes.flat[0].legend(fontsize=7)
    figure.supylabel("failed telegrams, %")
    _save(figure, path)


def plot_windows(data: dict[str, Any], path: Path) -> None:
    extremes = np.array(data["monte_carlo"]["legal"]["extremes_ns"])
    figure, axis = plt.subplots(figsize=(8, 2.6), layout="constrained")
    bins = np.arange(-1000, 1626, 62.5) - 31.25
    axis.hist(extremes[:, 0], bins, color=COLOURS["answer"], alpha=0.7, label="earliest pulse of an installation")
    axis.hist(extremes[:, 1], bins, color=COLOURS["request"], alpha=0.7, label="latest pulse of an installation")
    for at, text in ((-875, "P_WIN_EARLY"), (1500, "P_WIN_LATE")):
        axis.axvline(at, color="black", linestyle="--", linewidth=1)
        axis.text(at, axis.get_ylim()[1] * 0.9, f" {text}", ha="left" if at < 0 else "right")
    axis.set_xlabel("pulse start against the grid of the first pulse, ns")
    axis.set_ylabel("installations")
    axis.legend(fontsize=7, loc="upper center")
    _save(figure, path)


def plot_wave(path: Path) -> None:
    setup = Setup((Hop(bus()),))
    outcome = exchange(setup, encode_call("DEXG", 5, 10), 6, np.random.default_rng(1))[1]
    t = (np.arange(len(outcome.volts)) * CLOCK_NS - ANSWER_LEAD_NS) / 1e3
    figure, axes = plt.subplots(2, 1, figsize=(8, 3.4), sharex=True, height_ratios=(3, 1), layout="constrained")
    axes[0].plot(t, outcome.volts, color="black", linewidth=0.9)
    first = -outcome.volts[(t > -2) & (t < 3)].min()
    for sign in (-1, 1):
        axes[0].axhline(sign * Comparators().ratio * first, color=COLOURS["answer"], linestyle=":", linewidth=1)
    axes[0].set_ylabel("V behind the band pass")
    for bit, name, colour in ((1, "negative", COLOURS["request"]), (2, "positive", COLOURS["answer"])):
        axes[1].step(t, (outcome.levels & bit > 0) * 0.8 + (0 if bit == 1 else 1), color=colour, linewidth=0.9,
                     where="post", label=name)
    axes[1].set_yticks([0.4, 1.4], ["negative", "positive"])
    axes[1].set_xlabel("us from the first edge of the answer; left: the end of the request, as the master hears it")
    axes[1].set_xlim(-24, 48)
    _save(figure, path)


def _table(head: list[str], rows: list[list[str]]) -> list[str]:
    return ["| " + " | ".join(head) + " |", "|" + "---|" * len(head), *("| " + " | ".join(row) + " |" for row in rows)]


def _spice_rows() -> list[list[str]]:
    rows = []
    for case in CASES:
        own, reference = decimated(model(case)), read_reference(case)
        for k, probe in enumerate(case.probes):
            d = compare(own[k], reference[k], 500.0, with_starts=False)
            rows.append([case.name, probe, f"{d.max_mv:.1f} mV", f"{d.max_percent:.2f} %", f"{d.rms_mv:.2f} mV"])
    return rows


TEXT = """\
# Margins of the line

Where telegrams begin to fail when line, senders, front end and disturbances leave their nominal values: an analog model
of the line with the real receiver RTL (`rtl/phy/asi_rx.sv` and its filter, Verilated) behind its comparators.
Simulated, not measured on hardware. EK marks constants that are engineering knowledge, not from a public source.

Made by `{command}` on {date}.
Plots, tables and all counts as JSON: `build/margins`. One Monte Carlo sample again:
`make margins ARGS='--sample legal:7'`. On a cluster: `make margins SCHEDULER=tcp://host:8786`; its workers
start in the same checkout (shared or copied) with the receiver library built and `PYTHONPATH=.:host/python`.
This page: `make margins ARGS=--docs`.

## What a board designer can take from it

* **Least signal.** The threshold while nothing is held (0.6 V, EK) decides: requests are good down to
  {amplitude_request}, answers down to {amplitude_answer}; 3 Vpp is the least legal signal.
* **Noise in pauses.** The same 0.6 V is all there is against noise before a first pulse, so a stronger signal does not
  help much: white noise is good up to {white_3v} rms at 3 Vpp and {white_5v} at 5 Vpp (rms behind the band pass). A
  higher level there buys noise margin and costs weak signals.
* **Late pulses.** The peak hold sees the first pulse at that lower threshold, so all later pulses look late: about
  0.5 us on a clean line, {late} ns at most on all legal ones. The late window (1500 ns) is made for this; the early
  one (875 ns) is hardly used ({early} ns).
* **Sines.** 100 kHz at 3 Vpp is good up to {sine_3v} amplitude. The 30 % rule is about lone interference, and that
  holds: {ghost} of the amplitude. A lasting sine also moves the pulses.
* **DC.** Steps of {dip} with 20 us and 50 Hz of {mains} do no harm at 3 Vpp. A higher corner of the high pass helps
  both and costs signal.
* **Capacitance and damping.** {capacitance} of additional capacitance at the far end is the most (suppressors and
  filters of all devices together); decoupling without its resistors rings: {damping} in place of 78 Ohm still works.
* **Clock and jitter.** {fast} fast and {slow} slow are good, against a required 1000 ppm; so is jitter of +-{jitter}.
* **Repeaters** that re-time cost delay only: {repeaters} in series are good, then the answer comes after P_RX_TIMEOUT.
  Those that do not re-time cost late window each; {repeaters_raw} in series are good.

## One parameter at a time

Nominal: 100 m of straight line, 31 slaves, 60 mA, threshold 50 %, no disturbance; {telegrams} exchanges per value.
Request: at the far slave (14 bits). Answer: at the master (7 bits). Dotted: limits.

![failed telegrams over each parameter]({sweeps_svg})

{sweep_table}

"none" under "first error": no error up to the end of the sweep. Where the limits come from:

{sources}

## All at once (Monte Carlo)

{samples} installations per population, {exchanges} exchanges on each, seed {seed}: a random tree of up to 100 m per
segment, random cable, power unit and stations anywhere, up to 62 slaves, up to two repeaters, senders with 55..68 mA
and +-1000 ppm, thresholds 45..55 %.
*legal*: disturbances together below 0.45 V (30 % of the weakest legal pulse), jitter up to 100 ns, later pulses
90..110 % of the first. *stress*: up to 3 V, up to 1 us, 40..140 %, and foreign pulses.

{mc_table}

Bound: upper 95 % confidence bound (Clopper-Pearson) of the probability that a telegram of this population is accepted
wrongly, telegrams taken as independent.

{wrong}

{disturbance_table}

Pulse starts of accepted telegrams on the legal lines: {early} to {late} ns (windows -875 to +1500 ns).

![earliest and latest pulses]({windows_svg})

## The model

![an answer at the master]({wave_svg})

* **Senders**: current edges `t/T - sin(2 pi t/T)/(2 pi)`, T = 3 us, 55..68 mA (EK).
* **Line**: tree of lumped sections of at most 5 m (10 m in the Monte Carlo); data decoupling 100 uH parallel 78 Ohm
  (EK), the power unit an AC short; slaves 13.5 kOhm, 13 mH, 30 pF (data sheet). R' 20..90 mOhm/m, C' 30..80 pF/m,
  L' 0.4..1.3 uH/m, G' up to 5 uS/m (EK), impedance 80..120 Ohm.
* **Time**: exact state transition at 7.8 ns, the current linear within a step; edges are superposed on that grid.
* **Front end**: high pass 7 kHz (one pole), low pass 1 MHz (two poles) (EK); threshold 0.6 V until the first negative
  pulse, then 45..55 % of its peak, followed for 2.5 us (EK); hysteresis 5 % (EK); cleared when both comparators were
  silent for 9 us (EK), about when the chip ends its clear pulse (P_PAUSE 7.5 us and P_VTH_CLEAR 2 us after a pulse).
* **Repeaters**: own receiver, 2..5 us of delay, pulses leave on the 3 us grid of the first one (EK).
* **Not in it**: saturation and clipping, common mode, temperature, the shaper's own errors, a slave's own receiver (the
  chip's receiver with 14 bits stands in for it).

The line against ngspice, which has sections of 1 m; its waveforms are stored in `sim/line/reference`, and
`python -m sim.line.spice` runs it again where it is installed:

{spice_table}
"""


def _wrong(data: dict[str, Any]) -> str:
    """What the stress population says about undetected errors."""
    stress = data["monte_carlo"]["stress"]
    wrong, telegrams = (sum(stress[w][what] for w in WAYS) for what in ("wrong", "telegrams"))
    if not wrong:
        return f"Under stress none of {telegrams} telegrams was accepted with wrong content."
    least = min(b["from_v"] for b in stress["by_disturbance"] if b["wrong"])
    worst = max(stress["wrong"], key=lambda w: w["sample"])
    return (f"Under stress {wrong} of {telegrams} telegrams were accepted with wrong content, all with disturbances\n"
            f"above {least:g} V peak in sum. Two changed bits keep the parity; the line code cannot exclude that, the\n"
            f"receiver's checks make it rare. One to look at: `make margins ARGS='--sample stress:{worst['sample']}'`.")


def write_page(data: dict[str, Any], folder: Path, images: Path) -> None:
    """folder/margins.md with its three plots in images."""
    folder.mkdir(parents=True, exist_ok=True)
    images.mkdir(parents=True, exist_ok=True)
    plots = {what: images / f"margins_{what}.svg" for what in ("sweeps", "windows", "wave")}
    plot_sweeps(data, plots["sweeps"])
    plot_windows(data, plots["windows"])
    plot_wave(plots["wave"])
    fields: dict[str, Any] = {f"{what}_svg": os.path.relpath(path, folder) for what, path in plots.items()}
    for entry in data["sweeps"]:
        rising = entry["points"][-1]["value"] > entry["points"][0]["value"]
        good = [entry[w]["last_good"] for w in WAYS]
        both = None if None in good else min(good) if rising else max(good)
        for name, value in ((entry["name"], both), *((f"{entry['name']}_{w}", v) for w, v in zip(WAYS, good))):
            fields[name] = "no value" if value is None else f"{value:g} {entry['unit']}".strip()
    head = ["Parameter", "Limit (request / answer)", "Request: last good", "first error", "Answer: last good",
            "first error", "Limit kept"]
    rows = [[r[0], r[1], *r[2].split(" | "), *r[3].split(" | "), r[4]] for r in sweep_rows(data)]
    legal = data["monte_carlo"]["legal"]
    fields.update(
        {k: data[k] for k in ("command", "date", "seed")}, telegrams=data["telegrams_per_point"],
        samples=legal["samples"], exchanges=data["exchanges_per_sample"], early=f"{legal['early_ns']:+.0f}",
        late=f"{legal['late_ns']:+.0f}", wrong=_wrong(data), sweep_table="\n".join(_table(head, rows)),
        sources="\n".join(f"* {e['title']}: {e['source']}" for e in data["sweeps"] if e["source"]),
        mc_table="\n".join(_table(["Population", "Direction", "Telegrams", "Failed", "Accepted", "Accepted wrong",
                                   "Bound (95 %)", "Classes of the failed"], mc_rows(data))),
        disturbance_table="\n".join(_table(["Disturbances, sum of peaks", "Telegrams", "Failed", "Accepted wrong"], [
            [f"{population}: {b['from_v']:g}..{b['to_v']:g} V", str(b["telegrams"]), str(b["failed"]), str(b["wrong"])]
            for population in data["monte_carlo"] for b in data["monte_carlo"][population]["by_disturbance"]])),
        spice_table="\n".join(_table(["Network", "At", "Largest difference", "of the amplitude", "rms"],
                                      _spice_rows())))
    (folder / "margins.md").write_text(TEXT.format_map(fields))
