# SPDX-License-Identifier: Apache-2.0
"""The runner's view of the native simulation, against the real library of simulated slaves (no chip)."""
from pathlib import Path
from types import SimpleNamespace

import pytest

from asi import native
from asi.bench import BenchError, NativeBench, open_bench
from asi.plant import Codes, Faults, Slave, load_plant
from asi.regmap import ErrorClass
from asi.telegram import encode_call, request_pulses

PLANTS = Path(__file__).resolve().parents[2] / "sim/plants"
POWER_UP_NS = 20_000_000


@pytest.fixture
def bench():
    chip = SimpleNamespace(net=native.Net(seed=3), clk_hz=16_000_000)
    out = NativeBench(chip)
    out.now = POWER_UP_NS

    def ask(name, index, data=0):
        """One call on the line -> (class, nibble) of the answer."""
        for offset, polarity in request_pulses(encode_call(name, index, data, extended=False)):
            out.net.master_pulse(out.now + offset, polarity)
        out.now += 300_000
        out.net.advance(out.now)
        telegram, = out.net.log()
        return ErrorClass(telegram.error_class), telegram.data
    out.ask = ask
    return out


def test_slaves_arrive_as_described(bench):
    """PL-004: codes, inputs, presence and address of a plant's slave are those of the simulated slave."""
    bench.add(Slave("a", 5, Codes(3, 1, 0xC, 0xE), inputs=0b0010))
    bench.add(Slave("b", 6, Codes(0, 0, 15, 15), present=False))
    assert [bench.ask(call, 5) for call in ("RDIO", "RDID", "RID1", "RID2")] == [
        (ErrorClass.OK, code) for code in (3, 1, 0xC, 0xE)]
    assert bench.ask("RDIO", 6)[0] == ErrorClass.NO_RESPONSE
    bench.ask("WPAR", 5, 15)
    assert bench.ask("DEXG", 5, 15)[1] & 3 == 2
    bench.set_inputs(0, 0b0001)
    assert bench.ask("DEXG", 5, 15)[1] & 3 == 1


def test_deeds_reach_the_slave(bench):
    """PL-004: drop, connect, noise, quiet, fault and power of the runner act on the simulated slave."""
    handle = bench.add(Slave("a", 9, Codes(0, 0, 15, 15)))
    bench.set_present(handle, False)
    assert bench.ask("RDIO", 9)[0] == ErrorClass.NO_RESPONSE
    bench.set_present(handle, True)
    bench.now += POWER_UP_NS
    assert bench.ask("RDIO", 9) == (ErrorClass.OK, 0)
    bench.set_faults(handle, Faults(parity=65535))
    assert bench.ask("RDIO", 9)[0] == ErrorClass.PARITY
    bench.set_faults(handle, Faults(no_answer=65535))
    assert bench.ask("RDIO", 9)[0] == ErrorClass.NO_RESPONSE
    bench.set_faults(handle, Faults(missing_pulse=65535))
    assert bench.ask("RDIO", 9)[0] != ErrorClass.OK
    bench.set_faults(handle, Faults(extra_pulse=65535))
    assert bench.ask("RDIO", 9)[0] != ErrorClass.OK
    bench.set_faults(handle, Faults(shifted_pulse=65535, shift_ns=2_000))
    assert bench.ask("RDIO", 9)[0] != ErrorClass.OK
    bench.set_faults(handle, Faults())
    assert bench.ask("RDST", 9) == (ErrorClass.OK, 0)
    bench.set_periphery_fault(handle, True)
    assert bench.ask("RDST", 9) == (ErrorClass.OK, 2)
    bench.power(False)
    assert bench.ask("RDIO", 9)[0] == ErrorClass.NO_RESPONSE


def test_the_shipped_plants_fit_the_simulated_slaves(bench):
    """PL-004: every slave of the four plants is accepted by the native simulation."""
    for path in sorted(PLANTS.glob("*.toml")):
        slaves = load_plant(path).slaves
        handles = [bench.add(slave) for slave in slaves]
        assert len(set(handles)) == len(slaves)


def test_missing_parts_are_named(tmp_path, monkeypatch):
    """PL-002: without firmware or library the reason is one line, no traceback."""
    with pytest.raises(BenchError, match="asi.hex is missing: make firmware"):
        open_bench(tmp_path / "asi.hex", None, 1)
    (tmp_path / "asi.hex").write_text("00000000\n")

    def refuse(**arguments):
        raise native.NativeError("libasi_chip.so is missing")
    monkeypatch.setattr(native, "Chip", refuse)
    with pytest.raises(BenchError, match="libasi_chip.so is missing"):
        open_bench(tmp_path / "asi.hex", None, 1)
