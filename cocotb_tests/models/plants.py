# SPDX-License-Identifier: Apache-2.0
"""Plays a plant (asi.plant) on the Python models: its slaves, its events, its host, and its checks (PL-004)."""
import cocotb
from asi.plant import Plant
from asi.regmap import Phase
from asi.run import compare
from cocotb.triggers import RisingEdge, Timer

from .chip import Chip
from .faults import Faults
from .slaves import Slave

PER_ONE = 65_536                # unit of the probabilities in a plant
HOST_BITS = {"mode": "protected_mode", "offline": "offline", "data_exchange": "data_exchange",
             "auto_address": "auto_address_enable"}


def make_slaves(plant: Plant):
    """Slaves of the models, in the order of the plant."""
    return [Slave(s.index, s.codes.io, s.codes.id, s.codes.id1, s.codes.id2, s.inputs, s.watchdog, s.present)
            for s in plant.slaves]


def make_faults(value):
    """asi.plant.Faults -> Faults of the models."""
    rate = {name: getattr(value, name) / PER_ONE
            for name in ("no_answer", "parity", "missing_pulse", "shifted_pulse", "extra_pulse")}
    return Faults(**rate, shift_ns=value.shift_ns, delay_ns=value.delay_ns)


class Player:
    """A plant on a chip. Times of the plant count from the coupling of the line, a few clocks before the reset ends."""

    def __init__(self, dut, plant):
        self.plant = plant
        self.chip = Chip(dut, make_slaves(plant), plant.seed)
        self.cycle_max_ns = None        # longest period of sync_o in one go of data exchange
        self._sync_ns = None
        cocotb.start_soon(self._cycles())
        cocotb.start_soon(self._phases())

    async def _cycles(self):
        while True:
            await RisingEdge(self.chip.dut.sync_o)
            now = self.chip.pins.now()
            if self._sync_ns is not None:
                self.cycle_max_ns = max(self.cycle_max_ns or 0, now - self._sync_ns)
            self._sync_ns = now

    async def _phases(self):
        phase = self.chip.dut.phase_o
        while True:
            await phase.value_change
            if int(phase.value) < Phase.DATA_EXCHANGE:
                self._sync_ns = None    # a start-up is not a cycle

    async def start(self):
        """Reset, then what the host commits before the master starts."""
        host, window = self.plant.host, self.chip.host
        await self.chip.reset()
        await window.project({index: codes.word for index, codes in host.pcd.items()}, host.parameters)
        for index, nibble in host.outputs.items():
            await window.set_output(index, nibble)
        await window.control(protected_mode=host.protected, data_exchange=host.data_exchange,
                             auto_address_enable=host.auto_address, offline=0)
        assert await window.commit() == 0

    async def run(self):
        """The rest of the plant; AssertionError with all differences at the first check that is not met."""
        steps = [(a.time_ns, 0, a) for a in self.plant.actions()] + [(c.time_ns, 1, c) for c in self.plant.checks]
        for time_ns, _, step in sorted(steps, key=lambda s: s[:2]):
            await self.until(time_ns)
            if hasattr(step, "do"):
                await self._act(step)
            else:
                host = self.chip.host
                differences = compare(step, await host.state(), await host.inputs(), self.cycle_max_ns)
                assert not differences, f"at {time_ns} ns: {'; '.join(differences)}"

    async def until(self, time_ns):
        if (wait := time_ns - self.chip.pins.now()) > 0:
            await Timer(round(wait * 1_000), "ps")
        self.chip.settle()

    async def _act(self, action):
        chip = self.chip
        slaves = [chip.net.slaves[k] for k in action.slaves]
        match action.do:
            case "inputs":
                for slave in slaves:
                    slave.inputs = action.value
            case "drop" | "connect":
                for slave in slaves:
                    chip.net.set_present(slave, action.do == "connect")
            case "noise" | "quiet":
                for slave in slaves:
                    slave.faults = make_faults(action.value) if action.do == "noise" else Faults()
            case "periphery_fault" | "periphery_ok":
                for slave in slaves:
                    slave.periphery_fault = action.do == "periphery_fault"
            case "power_off" | "power_on":
                chip.supply(action.do == "power_on")
            case "apf_low" | "apf_high":
                chip.dut.apf_ni.value = int(action.do == "apf_high")
            case "output":
                await chip.host.set_output(*action.value)
            case _:
                await chip.host.control(**{HOST_BITS[action.do]: action.value})
                assert await chip.host.commit() == 0
