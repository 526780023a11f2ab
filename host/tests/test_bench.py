# SPDX-License-Identifier: Apache-2.0
"""The runner's view of the native simulation, against the real library of simulated slaves (no chip)."""
from pathlib import Path
from types import SimpleNamespace

import pytest

from asi import native
from asi.bench import BenchError, NativeBench, open_bench
from asi.plant import Codes, Faults, Options, Safety, Slave, load_plant
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


def test_combined_slaves_arrive_as_described():
    """PL-004, SL-009, SL-010: options, values, marks, strings and contacts of a plant's slave reach the simulated one,
    and only those that it has."""
    calls = []

    class Net:
        def __getattr__(self, name):
            def call(*arguments, **named):
                calls.append((name, *arguments, *named.values()))
                return 7 if name == "add" else 0x55
            return call
    out = NativeBench(SimpleNamespace(net=Net(), clk_hz=16_000_000))
    codes = Codes(7, 4, 15, 0xC)
    slave = Slave("a", 5, codes, values=(1, 2), invalid=1, overflow=2, strings={0: b"x", 2: b"y"},
                  safety=Safety((1,) * 8, 2), options=Options(write_ns=5, old=True))
    assert out.add(slave) == 7
    assert calls[1:] == [("set_options", 7, 5, False, False, True, False), ("set_value", 7, 0, 1),
                         ("set_value", 7, 1, 2), ("set_invalid", 7, 1, 2), ("set_string", 7, 0, b"x"),
                         ("set_string", 7, 2, b"y"), ("set_safety", 7, (1,) * 8, 2)]
    calls.clear()
    out.add(Slave("b", 6, codes))
    assert [call[0] for call in calls] == ["add"]
    assert out.get_value(7, 1) == 0x55 and calls[-1] == ("value", 7, 1)
    out.set_value(7, 1, 9)
    out.set_invalid(7, 1, 3)
    out.set_safety(7, (2,) * 8, 1)
    assert calls[-3:] == [("set_value", 7, 1, 9), ("set_invalid", 7, 1, 3), ("set_safety", 7, (2,) * 8, 1)]


def test_the_shipped_plants_fit_the_simulated_slaves(bench):
    """PL-004: every slave of the shipped plants is accepted by the native simulation."""
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
