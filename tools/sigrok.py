#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The sigrok decoder's folder, and waves of a run as a sigrok session.

usage: sigrok.py install [DIR]                 a decoder folder for sigrok, default build/sigrok (make sigrok)
       sigrok.py session WAVES OUT.sr [--mhz M]  the line's signals of a run (FST or VCD), sampled; default 8 MHz
"""
import argparse
import shutil
import sys
import zipfile
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIBRARY = ROOT / "host/python/asi"
DECODER = ROOT / "host/sigrok/asi"
# what pd.py imports, directly or not; all of it runs on the standard library (DE-014)
MODULES = ("capture", "checks", "decode", "monitor", "regmap", "telegram", "telegram_log")
SIGNALS = ("rx_p_i", "rx_n_i", "tx_man_o", "tx_en_o")
NAMES = ("rx_p", "rx_n", "tx_man", "tx_en")     # of the channels; the first two are the decoder's own


def install(folder: Path) -> None:
    """folder/asi: the decoder with the library modules it needs; an older one is replaced."""
    target = folder / "asi"
    if target.exists():
        shutil.rmtree(target)
    target.mkdir(parents=True)
    for name in ("__init__", "pd"):
        shutil.copy(DECODER / f"{name}.py", target)
    for name in MODULES:
        shutil.copy(LIBRARY / f"{name}.py", target)


def sample(changes: Iterable[tuple[float, int]], end_ns: float, rate: float) -> bytes:
    """[(t_ns, value)] in order of time, the first at 0 -> one byte per sample, the value at its instant."""
    out, value = bytearray(), 0
    for t_ns, new in changes:
        out += bytes([value]) * (-int(-t_ns * rate // 1e9) - len(out))
        value = new
    return bytes(out + bytes([value]) * (int(end_ns * rate / 1e9) - len(out)))


def write_session(path: Path, samples: bytes, rate: float, names: Iterable[str]) -> None:
    """A sigrok session: up to eight logic channels, bit 0 the first of names."""
    names = tuple(names)
    probes = "".join(f"probe{k}={name}\n" for k, name in enumerate(names, 1))
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("version", "2")
        file.writestr("metadata", "[global]\nsigrok version=0.5.2\n\n[device 1]\ncapturefile=logic-1\n"
                                  f"total probes={len(names)}\nsamplerate={rate / 1e6:g} MHz\ntotal analog=0\n{probes}"
                                  "unitsize=1\n")
        for number, at in enumerate(range(0, len(samples), 1 << 22), 1):
            file.writestr(f"logic-1-{number}", samples[at:at + (1 << 22)])


def session(waves: Path, out: Path, rate: float) -> None:
    """Sample the line's signals at the top of the chip."""
    import pywellen
    wave = pywellen.Waveform(str(waves), stream_only=True)
    found = {var.full_name: var for var in wave.all_vars()}
    try:
        wanted = [found[f"TOP.asi_master.{name}"] for name in SIGNALS]
    except KeyError as error:
        sys.exit(f"{waves}: no signal {error}")
    step_ns = wave.timescale.factor * {"ps": 1e-3, "ns": 1.0, "us": 1e3, "fs": 1e-6}[str(wave.timescale.unit)]
    changes: list[tuple[float, int]] = []
    last = 0.0

    def step(time: int, present: dict, _changed: object) -> None:
        nonlocal last
        last = time * step_ns
        value = sum((present[var.signal_id] == 1) << bit for bit, var in enumerate(wanted))
        if not changes or value != changes[-1][1]:
            changes.append((last, value))

    wave.stream_time_steps(step, wanted)
    write_session(out, sample(changes, last, rate), rate, NAMES)


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    one = commands.add_parser("install")
    one.add_argument("folder", type=Path, nargs="?", default=ROOT / "build/sigrok")
    two = commands.add_parser("session")
    two.add_argument("waves", type=Path)
    two.add_argument("out", type=Path)
    two.add_argument("--mhz", type=float, default=8.0)
    args = parser.parse_args(argv)
    if args.command == "install":
        install(args.folder)
    else:
        session(args.waves, args.out, args.mhz * 1e6)
    return 0


if __name__ == "__main__":
    sys.exit(main())
